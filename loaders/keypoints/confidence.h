// Confidences that pose estimators write in the place of v.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "manifests/sample.h"

namespace q3d::loaders::keypoints {

class ConfidenceWeights {
 public:
  // Keypoints of less confidence than `min_confidence` get weight 0: the reprojection error counts every
  // visible keypoint alike, so a guess must not be visible.
  explicit ConfidenceWeights(double min_confidence) : min_confidence_(min_confidence) {}

  // A labelled v below 1 is a confidence and becomes the weight; 1 and 2 are labels made by hand and keep
  // weight 1. v stays as it is.
  void apply(std::span<manifests::Keypoint> keypoints);

  // For people: how many there were; empty when there were none.
  std::string note() const;

 private:
  double min_confidence_;
  std::size_t confidences_ = 0;
  std::size_t below_ = 0;
};

}  // namespace q3d::loaders::keypoints
