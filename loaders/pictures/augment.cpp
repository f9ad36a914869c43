#include "loaders/pictures/augment.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/core.hpp>

#include "manifests/random.h"

namespace q3d::loaders::pictures {
namespace {

using manifests::uniform;

double normal(std::mt19937_64& engine) {  // Box-Muller; 1 - u keeps the logarithm finite
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform(engine)));
  return radius * std::cos(2.0 * std::numbers::pi * uniform(engine));
}

double cut_normal(std::mt19937_64& engine, double limit) {
  return std::clamp(normal(engine), -limit, limit);
}

cv::Matx33d matrix_from_axis_angle(const cv::Vec3d& axis_angle) {  // Rodrigues' formula
  const double angle = cv::norm(axis_angle);
  if (angle < std::numeric_limits<double>::epsilon()) return cv::Matx33d::eye();
  const cv::Vec3d k = axis_angle * (1.0 / angle);
  const cv::Matx33d cross{0.0, -k[2], k[1], k[2], 0.0, -k[0], -k[1], k[0], 0.0};
  return cv::Matx33d::eye() + std::sin(angle) * cross + (1.0 - std::cos(angle)) * (cross * cross);
}

cv::Vec3d axis_angle_from_matrix(const cv::Matx33d& r) {
  const cv::Vec3d skew{r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1)};  // 2 sin(angle) axis
  const double sine = cv::norm(skew) / 2.0;
  const double cosine = std::clamp((cv::trace(r) - 1.0) / 2.0, -1.0, 1.0);
  const double angle = std::atan2(sine, cosine);
  if (sine > 1e-5) return skew * (angle / (2.0 * sine));
  if (cosine > 0.0) return {0.0, 0.0, 0.0};
  // For a half turn the skew part vanishes: (R + I) / 2 = axis axis^T. The largest column gives the axis. Its
  // sign makes the first non-zero component positive, as in OpenCV.
  const cv::Matx33d outer = (r + cv::Matx33d::eye()) * 0.5;
  int column = 0;
  for (int i = 1; i < 3; ++i) {
    if (outer(i, i) > outer(column, column)) column = i;
  }
  cv::Vec3d axis{outer(0, column), outer(1, column), outer(2, column)};
  axis = axis * (1.0 / cv::norm(axis));
  const double lead = std::abs(axis[0]) > 1e-9 ? axis[0] : (std::abs(axis[1]) > 1e-9 ? axis[1] : axis[2]);
  return axis * (lead < 0.0 ? -angle : angle);
}

}  // namespace

Augmentation draw_augmentation(const AugmentOptions& options, std::mt19937_64& engine) {
  Augmentation drawn;
  drawn.shift_x = cut_normal(engine, 1.0) * options.shift;
  drawn.shift_y = cut_normal(engine, 1.0) * options.shift;
  drawn.scale = 1.0 + cut_normal(engine, 1.0) * options.scale;
  if (uniform(engine) < options.rotation_rate)
    drawn.rotation_deg = cut_normal(engine, 2.0) * options.rotation_deg;
  for (double& channel : drawn.colour) channel = 1.0 + (2.0 * uniform(engine) - 1.0) * options.colour;
  if (options.mirror_rate > 0.0) drawn.mirror = uniform(engine) < options.mirror_rate;
  return drawn;
}

Affine augmented_patch_from_image(const SquareBox& box, const Augmentation& augmentation) {
  SquareBox shifted = box;
  shifted.center_x_px += box.side_px * augmentation.shift_x;
  shifted.center_y_px += box.side_px * augmentation.shift_y;
  const Affine upright =
      patch_from_image(shifted, kPatchSidePx, augmentation.scale, augmentation.rotation_deg);
  constexpr Affine kTurnedOver{-1.0, 0.0, kPatchSidePx, 0.0, 1.0, 0.0};
  return augmentation.mirror ? compose(kTurnedOver, upright) : upright;
}

smal::Keypoints3d rotate_keypoints_3d(const smal::Keypoints3d& keypoints, double rotation_deg) {
  const double angle_rad = -rotation_deg * std::numbers::pi / 180.0;
  const auto cosine = static_cast<float>(std::cos(angle_rad));
  const auto sine = static_cast<float>(std::sin(angle_rad));
  auto turned = keypoints;
  for (std::size_t i = 0; i < turned.size(); i += 3) {
    turned[i] = cosine * keypoints[i] - sine * keypoints[i + 1];
    turned[i + 1] = sine * keypoints[i] + cosine * keypoints[i + 1];
  }
  return turned;
}

std::array<float, 3> rotate_global_orient(const std::array<float, 3>& axis_angle, double rotation_deg) {
  const double angle_rad = -rotation_deg * std::numbers::pi / 180.0;
  const cv::Matx33d turn = matrix_from_axis_angle({0.0, 0.0, angle_rad});
  const cv::Matx33d orient = matrix_from_axis_angle({axis_angle[0], axis_angle[1], axis_angle[2]});
  const cv::Vec3d turned = axis_angle_from_matrix(turn * orient);
  return {static_cast<float>(turned[0]), static_cast<float>(turned[1]), static_cast<float>(turned[2])};
}

}  // namespace q3d::loaders::pictures
