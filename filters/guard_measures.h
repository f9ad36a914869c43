// The numbers that the guards' bounds look at. Pure functions of bodies, keypoints and masks.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace q3d::filters {

// Official code: PosePriorLoss. Row-major.
struct PosePrior {
  std::vector<double> mean;   // 105 rad: axis-angle of 35 joints, the global orientation first
  std::vector<double> precs;  // 105 x 105: deviation @ precs has unit variance
  std::vector<double> use;    // 105 of 0 and 1: 0 for the global orientation
};

// How far a pose lies from the prior: the root mean square of the whitened deviation over the numbers in use.
// About 1 for poses that the prior was made from. rotations: 35 row-major 3x3 matrices. Throws
// std::invalid_argument on wrong counts or a prior that uses no number.
double pose_deviation(std::span<const float> rotations, const PosePrior& prior);

// The twelve leg bones (shoulder or hip to foot, left fore, right fore, left hind, right hind) over the
// length of the spine, joint by joint from the root to the withers. A bone's length does not depend on the
// pose, so posed joints do. joints: 35 x 3, any unit. Throws std::invalid_argument on another count; numbers
// are not finite when the spine has no length.
std::array<double, 12> relative_limb_lengths(std::span<const float> joints);

// The range of relative limb lengths over some bodies.
struct LimbRange {
  std::array<double, 12> least;
  std::array<double, 12> most;
};
// Throws std::invalid_argument without bodies or on lengths that are not above 0 and finite.
LimbRange limb_range(std::span<const std::array<double, 12>> bodies);

// By what factor the worst limb is longer than the longest or shorter than the shortest of the range: at
// most 1 when all lie within it; infinite for a limb without length.
double limb_factor(const std::array<double, 12>& lengths, const LimbRange& range);

// Mean error of the keypoints that have a mirror image and are visible together with it, as annotated, over
// the same with left and right exchanged in the annotation. Below 1 when the label has its sides right; NaN
// without such a pair. projected: 26 x (x, y); annotated: 26 x (x, y, weight), crop units; mirror: the index
// of each keypoint's mirror image. Throws std::invalid_argument on wrong counts.
double left_right_ratio(std::span<const float> projected, std::span<const float> annotated,
                        std::span<const int> mirror);

// Intersection over union of two silhouettes of equal size, pixels of 128 and more being inside. NaN when
// both are empty. Throws std::invalid_argument when the sizes differ.
double mask_iou(std::span<const std::uint8_t> one, std::span<const std::uint8_t> other);

}  // namespace q3d::filters
