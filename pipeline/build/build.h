// The main job: annotated photographs in, a versioned dataset out.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/config/build_config.h"
#include "pipeline/dataset/dataset_manifest.h"
#include "pipeline/run/run_options.h"
#include "pipeline/stages/build_plan.h"
#include "pipeline/stages/stage.h"

namespace q3d::pipeline::build {

// Options of a build that neither its config nor the run's options hold.
struct BuildRequest {
  // The last stage that the run makes. If it is empty, the run makes all stages and the finished dataset. A
  // later run continues from there and ends with the same bytes as a single run.
  std::optional<stages::Stage> until;
  // The words after the program's name that run this build again, for `status`.
  std::vector<std::string> command;
};

struct BuildSummary {
  dataset::DatasetManifest dataset;            // empty if the run stopped after a stage
  std::filesystem::path folder;                // <out>/<name>-<key>
  stages::BuildPlan plan;                      // of the whole build
  std::optional<stages::Stage> stopped_after;  // the requested last stage; nothing if the dataset is finished
  double seconds = 0.0;
  bool was_up_to_date = false;
  std::vector<candidates::IngestNote> notes;  // notes on reading the datasets
  int rank = 0;  // rank 0 reports for all; the summaries of other ranks have no dataset
  std::int64_t crops_encoded =
      0;  // stored crops, by this process, that no earlier build had left in the output folder
};

// Makes <out>/<name>-<key>/ and points <out>/latest at it. Continues where an earlier run ended. Throws
// ConfigError, std::runtime_error, Interrupted. It also throws std::runtime_error, before any work, if a
// tau_high is above filter.tau_ceiling (unless options.above_ceiling); and if no label was kept; the folder
// with its verdicts then exists, but <out>/latest is unchanged. Warnings about the labels' quality are in
// summary.dataset.warnings and were logged. With request.until the run ends after that stage and publishes
// nothing, unless the finished dataset exists already. With options.shares_units the ranks that a launcher
// started share the units, and rank 0 publishes the same bytes as one process (rank_share.h).
BuildSummary build(const config::BuildConfig& config, const run::RunOptions& options,
                   const BuildRequest& request = {});

}  // namespace q3d::pipeline::build
