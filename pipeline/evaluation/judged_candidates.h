// Reads back from an output folder what a build made of its candidates: verdicts as published, the network's
// predictions and the refined bodies. Neither annotation files nor pictures are read.
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
  std::optional<device::BodyPrediction> refined;  // of the refined

  // The body that went into the dataset; null when the candidate is not in it.
  const device::BodyPrediction* label() const;
};

struct JudgedPool {
  std::vector<JudgedCandidate> candidates;  // of role `pseudo` and with a prediction, in ingest order
  std::int64_t failed = 0;                  // of role `pseudo`, without a prediction
  std::string dataset;                      // name of the version folder
  std::string content_id;
};

// Reads the pool of the dataset that `config` has built in `out`. Throws ConfigError when the config has no
// dataset of role `pseudo` or no thresholds, and std::runtime_error when its dataset has not been published
// in `out`, when a stage's files are gone, or when they were made anew for other candidates or pictures.
JudgedPool read_judged_pool(const config::BuildConfig& config, const std::filesystem::path& out);

}  // namespace q3d::pipeline::evaluation
