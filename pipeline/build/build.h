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
  // The last stage that the run makes; nothing: all stages, and the finished dataset. A later run goes on
  // from there and ends with the same bytes as one run.
  std::optional<stages::Stage> until;
  // The words after the program's name that run this build again, for `status`.
  std::vector<std::string> command;
};

struct BuildSummary {
  dataset::DatasetManifest dataset;            // empty if the run stopped after a stage
  std::filesystem::path folder;                // <out>/<name>-<key>
  stages::BuildPlan plan;                      // of the whole build
  std::optional<stages::Stage> stopped_after;  // as it was asked; nothing if the dataset is finished
  double seconds = 0.0;
  bool was_up_to_date = false;
  std::vector<candidates::IngestNote> notes;  // of reading the datasets
  int rank = 0;                               // rank 0 speaks for all; the others' summaries have no dataset
  std::int64_t crops_encoded =
      0;  // stored crops, by this process, that no earlier build had left in the output folder
};

// Makes <out>/<name>-<key>/ and points <out>/latest at it; goes on where an earlier run ended. Throws
// ConfigError, std::runtime_error, Interrupted. It also throws std::runtime_error, before any work, if a
// tau_high is above filter.tau_ceiling (unless options.above_ceiling); and if no label was kept: then the
// folder is there, with its verdicts, but <out>/latest stays where it was. Warnings about the labels' quality
// are in summary.dataset.warnings, and were told to the log. With request.until the run ends after that stage
// and publishes nothing, unless the finished dataset is there already. With options.shares_units the ranks
// that a launcher started share the units, and rank 0 publishes the same bytes as one process (rank_share.h).
BuildSummary build(const config::BuildConfig& config, const run::RunOptions& options,
                   const BuildRequest& request = {});

}  // namespace q3d::pipeline::build
