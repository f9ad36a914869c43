#include "pipeline/device/network.h"

#include <algorithm>
#include <cmath>

#include "smal/numbers.h"

namespace q3d::pipeline::device {
namespace {

template <typename T>
bool all_finite(const T& values) {
  return std::all_of(values.begin(), values.end(), [](float value) { return std::isfinite(value); });
}

}  // namespace

bool is_finite(const BodyPrediction& body) {
  return all_finite(body.pose) && all_finite(body.betas) && all_finite(smal::numbers_of(body.camera)) &&
         all_finite(body.translation) && all_finite(body.keypoints_3d) &&
         all_finite(smal::numbers_of(body.keypoints_2d)) &&
         all_finite(smal::numbers_of(body.aux_keypoints_2d));
}

}  // namespace q3d::pipeline::device
