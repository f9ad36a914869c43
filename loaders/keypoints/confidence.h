// Handles confidences, which pose estimators write instead of v.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "manifests/sample.h"

namespace q3d::loaders::keypoints {

class ConfidenceWeights {
 public:
  // Keypoints with a confidence below `min_confidence` get weight 0. The reprojection error counts all
  // visible keypoints alike, so a guess must not be visible.
  explicit ConfidenceWeights(double min_confidence) : min_confidence_(min_confidence) {}

  // If a labelled v is below 1, it is a confidence and becomes the weight. 1 and 2 are labels made by hand
  // and keep weight 1. v itself does not change.
  void apply(std::span<manifests::Keypoint> keypoints);

  // Returns a note for people that says how many confidences there were; empty if there were none.
  std::string note() const;

 private:
  double min_confidence_;
  std::size_t confidences_ = 0;
  std::size_t below_ = 0;
};

}  // namespace q3d::loaders::keypoints
