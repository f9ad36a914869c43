// The main job: annotated photographs in, a versioned dataset out.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "pipeline/config/build_config.h"
#include "pipeline/dataset/dataset_manifest.h"
#include "pipeline/run/run_options.h"

namespace q3d::pipeline::build {

struct BuildSummary {
  dataset::DatasetManifest dataset;
  std::filesystem::path folder;  // <out>/<name>-<key>
  double seconds = 0.0;
  bool was_up_to_date = false;
  std::vector<candidates::IngestNote> notes;  // of reading the datasets
  std::int64_t crops_encoded = 0;  // stored crops that no earlier build had left in the output folder
};

// Makes <out>/<name>-<key>/ and points <out>/latest at it; goes on where an earlier run ended. Throws
// ConfigError, std::runtime_error, Interrupted. It also throws std::runtime_error, before any work, if a
// tau_high is above filter.tau_ceiling (unless options.above_ceiling); and if no label was kept: then the
// folder is there, with its verdicts, but <out>/latest stays where it was. Warnings about the labels' quality
// are in summary.dataset.warnings, and were told to the log.
BuildSummary build(const config::BuildConfig& config, const run::RunOptions& options);

}  // namespace q3d::pipeline::build
