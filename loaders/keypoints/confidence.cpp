#include "loaders/keypoints/confidence.h"

#include <fmt/format.h>

namespace q3d::loaders::keypoints {

void ConfidenceWeights::apply(std::span<manifests::Keypoint> keypoints) {
  for (manifests::Keypoint& point : keypoints) {
    if (!(point.weight > 0.0F && point.v < 1.0F)) continue;
    ++confidences_;
    const bool is_kept = point.v >= static_cast<float>(min_confidence_);
    point.weight = is_kept ? point.v : 0.0F;
    below_ += is_kept ? 0 : 1;
  }
}

std::string ConfidenceWeights::note() const {
  if (confidences_ == 0) return {};
  return fmt::format(
      "keypoints whose v is a confidence, which becomes their weight: {}; of these, below min_confidence {} "
      "(weight 0): {}",
      confidences_, min_confidence_, below_);
}

}  // namespace q3d::loaders::keypoints
