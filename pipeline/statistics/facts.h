// Gathers the facts about each candidate of a finished dataset, once for all statistics.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "manifests/sample.h"
#include "pipeline/config/role.h"
#include "pipeline/dataset/published_dataset.h"

namespace q3d::pipeline::statistics {

// Says how well a body's keypoints fit the annotated ones. Distances are Euclidean, in crop units (crop side
// = 1), and NaN where the keypoint is not visible.
struct Fit {
  std::array<float, smal::kNumKeypoints> distance{};
  double auc = 0.0;  // filters::auc with the whole crop as normaliser, 0 to 1
};

struct CandidateFacts {
  dataset::VerdictRow row;
  config::Role role = config::Role::pseudo;

  // The facts below are unknown if the unit's tables are gone and the candidate was not kept.
  bool has_geometry = false;
  int visible = 0;  // keypoints
  double box_w_px = 0.0, box_h_px = 0.0;
  int image_w_px = 0, image_h_px = 0;  // 0 if the picture could not be read

  std::optional<Fit> prediction;     // for role pseudo
  std::optional<Fit> label;          // for kept candidates whose body has a projection
  std::optional<smal::Betas> betas;  // for kept candidates with a shape
};

struct Facts {
  std::vector<CandidateFacts> candidates;  // in ingest order
  std::vector<std::string> missing;        // things that could not be found, for people
};

// Reads verdicts.csv, the tables of predict and refine, and the shards for kept candidates whose tables are
// gone. Throws std::runtime_error for a file that is damaged, and Interrupted.
Facts gather(const dataset::PublishedDataset& dataset);

}  // namespace q3d::pipeline::statistics
