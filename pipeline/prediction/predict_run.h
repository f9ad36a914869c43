// `predict`: predicts a body for every animal of the config's datasets, and adapts it if keypoints are known.
// It judges nothing and makes no dataset.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "manifests/sample.h"
#include "pipeline/config/build_config.h"
#include "pipeline/device/network.h"
#include "pipeline/run/run_options.h"

namespace q3d::pipeline::prediction {

// One animal of a photograph. `record` has its box and keypoints in the picture's pixels.
struct PredictedAnimal {
  manifests::SampleRecord record;
  manifests::Reason failure = manifests::Reason::none;
  std::string detail;  // of the failure
  int image_width_px = 0;
  int image_height_px = 0;
  device::BodyPrediction body;  // valid if failure is none; the adapted body if there is one

  // These are set only for an animal that was adapted: L_proj of the iterates 0..n in crop units, and which
  // of them `body` is.
  std::vector<double> curve;
  int best_iteration = 0;
};

struct PredictionSummary {
  std::vector<PredictedAnimal> animals;  // in the order of the datasets and their files
  std::vector<std::string> notes;        // notes on loading
  std::string checkpoint_sha256;
  std::string smal_asset_sha256;
  std::int64_t failed = 0;
  std::int64_t adapted = 0;
  double seconds = 0.0;
};

struct PredictOptions {
  run::RunOptions run;
  int iterations = 0;  // iterations of test-time adaptation; 0 = none
};

// Predicts unit by unit and leaves each finished unit in <out>/stages, where a later run finds it. So an
// interrupted run can continue, and a build in the same folder uses the same predictions. Adaptation takes
// all its iterations and keeps the iterate of least L_proj. Throws ConfigError, std::runtime_error,
// Interrupted.
PredictionSummary predict(const config::BuildConfig& config, const PredictOptions& options);

}  // namespace q3d::pipeline::prediction
