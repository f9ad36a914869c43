// Computes the numbers that the guards' bounds apply to, as pure functions of bodies, keypoints and masks.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "smal/keypoints.h"

namespace q3d::filters {

// The prior of the poses. Matrices are row-major. Official code: PosePriorLoss.
struct PosePrior {
  std::vector<double> mean;   // 105 rad: axis-angle of 35 joints, the global orientation first
  std::vector<double> precs;  // 105 x 105: deviation @ precs has unit variance
  std::vector<double> use;    // 105 of 0 and 1: 0 for the global orientation
};

// Returns how far a pose lies from the prior: the root mean square of the whitened deviation over the numbers
// in use. It is about 1 for poses that the prior was made from. rotations: 35 row-major 3x3 matrices. Throws
// std::invalid_argument for wrong counts and for a prior that uses no number.
double pose_deviation(std::span<const float> rotations, const PosePrior& prior);

// The prior of the shapes, with one entry for each family. Official code: ShapePriorLoss.
struct ShapePrior {
  struct Family {
    std::vector<double> mean;   // 41 betas
    std::vector<double> precs;  // 41 x 41, row-major: deviation @ precs has unit variance
  };
  std::vector<Family> families;
};

// Returns how far betas lie from a family's shapes: the root mean square of the whitened deviation, about 1
// for shapes that the prior was made from. `family` is the index of the family; for -1 the nearest one
// counts. Throws std::invalid_argument for wrong counts, a family that the prior lacks, and a prior without
// families.
double shape_deviation(std::span<const float> betas, int family, const ShapePrior& prior);

// Returns the 3D keypoints of a mirrored picture's body as those of the picture itself: x changes its sign,
// and left and right change places. keypoints: 26 x 3, camera frame; mirror: the index of each keypoint's
// mirror image. Throws std::invalid_argument for wrong counts.
std::vector<float> mirrored_keypoints(std::span<const float> keypoints, std::span<const int> mirror);

// Returns the mean of |a - b| over all numbers of two lists. Throws std::invalid_argument for lists that are
// empty or of different lengths.
double mean_absolute_difference(std::span<const float> a, std::span<const float> b);

// Returns the lengths of the twelve leg bones (from shoulder or hip to foot: left fore, right fore, left
// hind, right hind), divided by the length of the spine, which is measured joint by joint from the root to
// the withers. A bone's length does not depend on the pose, so posed joints may be given. joints: 35 x 3, any
// unit. Throws std::invalid_argument for another count. The numbers are not finite if the spine has no
// length.
std::array<double, 12> relative_limb_lengths(std::span<const float> joints);

// The range of relative limb lengths over some bodies.
struct LimbRange {
  std::array<double, 12> least;
  std::array<double, 12> most;
};
// Returns the range over `bodies`. Throws std::invalid_argument without bodies, and for lengths that are not
// finite and above 0.
LimbRange limb_range(std::span<const std::array<double, 12>> bodies);

// Returns the factor by which the worst limb is longer than the longest, or shorter than the shortest, of the
// range. It is at most 1 if all limbs lie within the range, and infinite for a limb without length.
double limb_factor(const std::array<double, 12>& lengths, const LimbRange& range);

// Returns the mean error of the keypoints that are visible together with their mirror image, divided by the
// same error with left and right exchanged in the annotation. It is below 1 if the label has its sides right,
// and NaN without such a pair. mirror: the index of each of the 26 keypoints' mirror image. Throws
// std::invalid_argument for another count.
double left_right_ratio(const smal::CropPoints& projected, const smal::CropKeypoints& annotated,
                        std::span<const int> mirror);

// Returns the intersection over union of two silhouettes of equal size. Pixels of 128 and more are inside.
// NaN if both are empty. Throws std::invalid_argument if the sizes differ.
double mask_iou(std::span<const std::uint8_t> one, std::span<const std::uint8_t> other);

}  // namespace q3d::filters
