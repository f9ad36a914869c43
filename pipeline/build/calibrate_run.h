// `calibrate`: finds thresholds for a pool and a network that give the wanted shares.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "filters/calibrated_pool.h"
#include "pipeline/build/build.h"
#include "pipeline/config/build_config.h"

namespace q3d::pipeline::build {

struct CalibrationSummary {
  std::vector<filters::CalibratedPool> pools;
  std::vector<dataset::Warning> warnings;  // why labels of this pool may be worth little; they were logged
  std::int64_t candidates = 0;
  double seconds = 0.0;
  int rank = 0;  // rank 0 reports for all; the summaries of other ranks are empty
};

// Predicts every candidate (a later build finds the predictions in the same output folder), then adapts
// candidates in order of their error, under the guards that change adaptation, until enough of them reach
// delta. AUC is measured against the annotated keypoints, normalised by the whole crop. With
// config.calibrate.per_dataset every dataset is a separate pool. Throws ConfigError, std::runtime_error (also
// if a tau_high is above filter.tau_ceiling, unless options.above_ceiling), Interrupted. With
// options.shares_units the ranks that a launcher started share the predictions (rank_share.h), and rank 0
// adapts.
CalibrationSummary calibrate(const config::BuildConfig& config, const run::RunOptions& options);

// Writes a config layer with the thresholds, for `build --config`.
void write_thresholds(const std::filesystem::path& path, const CalibrationSummary& summary);
std::string thresholds_layer(const CalibrationSummary& summary);  // its text

}  // namespace q3d::pipeline::build
