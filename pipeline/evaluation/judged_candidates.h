// What a build made of its candidates, read back from its output folder: verdicts as published, the network's
// predictions and the refined bodies.
#pragma once

#include <optional>
#include <vector>

#include "pipeline/build/workspace.h"

namespace q3d::pipeline::evaluation {

struct JudgedCandidate {
  manifests::SampleRecord record;
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

// Throws ConfigError when the config has no dataset of role `pseudo` or no thresholds, and std::runtime_error
// when its dataset has not been published in workspace.out(), or a stage's files are gone.
JudgedPool read_judged_pool(const config::BuildConfig& config, build::Workspace& workspace);

}  // namespace q3d::pipeline::evaluation
