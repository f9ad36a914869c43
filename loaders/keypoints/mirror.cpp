#include "loaders/keypoints/mirror.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "loaders/keypoints/topology.h"
#include "manifests/sample.h"

namespace q3d::loaders::keypoints {
namespace {

constexpr std::size_t kJoints = manifests::kNumJoints;
constexpr std::size_t kRotation = 9;

void require_size(const char* what, std::size_t got, std::size_t expected) {
  if (got == expected) return;
  throw std::invalid_argument(fmt::format("{}: got {} numbers, expected {}", what, got, expected));
}

// Returns the mirror image of each joint. The four joints of each limb and the ears are pairs of left and
// right; every other joint is its own mirror image.
constexpr std::array<std::size_t, kJoints> mirrored_joints() {
  std::array<std::size_t, kJoints> partner{};
  std::iota(partner.begin(), partner.end(), std::size_t{0});
  for (std::size_t left_first : {7, 17}) {
    for (std::size_t joint = left_first; joint < left_first + 4; ++joint) {
      partner[joint] = joint + 4;
      partner[joint + 4] = joint;
    }
  }
  partner[33] = 34;
  partner[34] = 33;
  return partner;
}

// Replaces R by diag(left) R diag(right), where the entries of both are 1 or -1.
void change_signs(float* rotation, const std::array<float, 3>& left, const std::array<float, 3>& right) {
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column)
      rotation[3 * row + column] *= left[row] * right[column];
  }
}

}  // namespace

void swap_keypoint_sides(std::span<float> rows, std::size_t width) {
  require_size("swap_keypoint_sides", rows.size(), manifests::kNumKeypoints * width);
  static const std::vector<int> kPartner = topology("animal3d26").flip;
  for (std::size_t k = 0; k < kPartner.size(); ++k) {
    const auto other = static_cast<std::size_t>(kPartner[k]);
    if (other > k) std::swap_ranges(&rows[k * width], &rows[k * width] + width, &rows[other * width]);
  }
}

void mirror_pose(std::span<float> rotations) {
  require_size("mirror_pose", rotations.size(), kJoints * kRotation);
  constexpr std::array<std::size_t, kJoints> kPartner = mirrored_joints();
  constexpr std::array<float, 3> kAcrossBody{1.0F, 1.0F, -1.0F};
  constexpr std::array<float, 3> kAcrossPicture{-1.0F, 1.0F, 1.0F};
  for (std::size_t joint = 0; joint < kJoints; ++joint) {
    float* rotation = &rotations[joint * kRotation];
    const std::size_t other = kPartner[joint];
    if (other > joint) std::swap_ranges(rotation, rotation + kRotation, &rotations[other * kRotation]);
  }
  for (std::size_t joint = 0; joint < kJoints; ++joint) {
    change_signs(&rotations[joint * kRotation], joint == 0 ? kAcrossPicture : kAcrossBody, kAcrossBody);
  }
}

}  // namespace q3d::loaders::keypoints
