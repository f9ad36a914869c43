// The main job: annotated photographs in, a versioned dataset out.
#pragma once

#include <filesystem>
#include <string>

#include "pipeline/build_config.h"
#include "pipeline/dataset_manifest.h"

namespace q3d::pipeline {

struct RunOptions {
  std::filesystem::path out;
  int threads = 0;     // of the flow graph; 0 = all cores. Never changes a byte of the result.
  bool quiet = false;  // no progress on stderr
};

struct BuildSummary {
  DatasetManifest dataset;
  std::filesystem::path folder;  // <out>/<name>-<key>
  double seconds = 0.0;
  bool was_up_to_date = false;
};

// Makes <out>/<name>-<key>/ and points <out>/latest at it; goes on where an earlier run ended. Throws
// ConfigError, std::runtime_error, Interrupted.
BuildSummary build(const BuildConfig& config, const RunOptions& options);

}  // namespace q3d::pipeline
