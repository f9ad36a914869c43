// `calibrate`: thresholds for a pool and a network, from the shares that should come out.
#pragma once

#include <filesystem>

#include "filters/calibrate.h"
#include "pipeline/build.h"
#include "pipeline/build_config.h"

namespace q3d::pipeline {

struct CalibrationSummary {
  filters::Calibration calibration;
  std::int64_t candidates = 0;
  std::int64_t judged = 0;   // candidates with a prediction
  std::int64_t adapted = 0;  // of the middle band, to see whether they reach delta
  double seconds = 0.0;
};

// Predicts every candidate (a later build finds the predictions in the same output folder), then adapts
// candidates in order of their error until enough of them reach delta. Throws ConfigError,
// std::runtime_error, Interrupted.
CalibrationSummary calibrate(const BuildConfig& config, const RunOptions& options);

// A config layer with the thresholds, for `build --config`.
void write_thresholds(const std::filesystem::path& path, const filters::Thresholds& thresholds);

}  // namespace q3d::pipeline
