// Reads the results of a build from its output folder: the published verdicts, the network's predictions and
// the refined bodies. It reads neither annotation files nor pictures.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/verdict.h"
#include "pipeline/config/build_config.h"
#include "pipeline/device/network.h"

namespace q3d::pipeline::evaluation {

struct JudgedCandidate {
  manifests::SampleRecord record;  // id, dataset, split, image_ref, box and keypoints; nothing else
  int image_width_px = 0;
  int image_height_px = 0;
  bool has_mask = false;  // the annotation file names a mask that could be used
  manifests::Verdict verdict = manifests::Verdict::failed;
  manifests::Reason reason = manifests::Reason::none;
  device::BodyPrediction predicted;               // before refinement
  std::optional<device::BodyPrediction> refined;  // set for refined candidates

  // Returns the body in the dataset, or null if the candidate is not in it.
  const device::BodyPrediction* label() const;
};

struct JudgedPool {
  std::vector<JudgedCandidate> candidates;  // candidates of role `pseudo` with a prediction, in ingest order
  std::int64_t failed = 0;                  // candidates of role `pseudo` without a prediction
  std::string dataset;                      // name of the version folder
  std::string content_id;
};

// Reads the pool of the dataset that was built with `config` in `out`. Throws ConfigError if the config has
// no dataset of role `pseudo` or no thresholds, and std::runtime_error if its dataset has not been published
// in `out`, or if a stage's files are gone or were replaced by those of other candidates or pictures.
JudgedPool read_judged_pool(const config::BuildConfig& config, const std::filesystem::path& out);

}  // namespace q3d::pipeline::evaluation
