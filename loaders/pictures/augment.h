// Training augmentation: what is drawn, and what it does to boxes, 3D keypoints and the global orientation.
//
// Official code: do_augmentation and get_example. Its mirror flip and its extreme crop crash there and are
// off in every released configuration. The extreme crop is not offered here; the mirror is our own
// (loaders/keypoints/mirror.h) and off by default.
#pragma once

#include <array>
#include <random>

#include "loaders/pictures/crop.h"
#include "manifests/sample.h"

namespace q3d::loaders::pictures {

struct AugmentOptions {        // the official configuration's values
  double scale = 0.3;          // box side times 1 +- this
  double rotation_deg = 30.0;  // standard deviation, cut at two of them
  double rotation_rate = 0.6;  // share of samples that are rotated
  double shift = 0.02;         // of the box side, each axis
  double colour = 0.2;         // each channel times 1 +- this
  double mirror_rate = 0.0;    // share of samples that are turned over, left for right
};

struct Augmentation {
  double scale = 1.0;         // > 1 shows more of the surroundings
  double rotation_deg = 0.0;  // of the box in the image; the patch's content turns the other way
  double shift_x = 0.0;       // of the unscaled box side
  double shift_y = 0.0;
  std::array<double, 3> colour{1.0, 1.0, 1.0};  // R, G, B; for normalise_patch
  bool mirror = false;                          // of the patch, after all else
};

// The official distributions: normal numbers cut at +-1 for shift and scale, at +-2 for rotation, uniform
// colour. The sequence depends on the engine's state alone, not on the standard library's distributions.
Augmentation draw_augmentation(const AugmentOptions& options, std::mt19937_64& engine);

// Image px -> patch px under an augmentation; feed it to warp_patch and keypoints_to_crop. A mirrored patch
// is turned over about the crop camera's principal point, px 128.
Affine augmented_patch_from_image(const SquareBox& box, const Augmentation& augmentation);

// Turns 3D keypoints (x, y, z) by -rotation_deg about the camera's z axis, in float32.
// Official code: keypoint_3d_processing.
std::array<float, manifests::kNumKeypoints * 3> rotate_keypoints_3d(
    const std::array<float, manifests::kNumKeypoints * 3>& keypoints, double rotation_deg);

// Turns an axis-angle orientation (rad) by -rotation_deg about the camera's z axis. The result's angle lies
// in [0, pi], also for rotation 0. Official code: rot_aa.
std::array<float, 3> rotate_global_orient(const std::array<float, 3>& axis_angle, double rotation_deg);

}  // namespace q3d::loaders::pictures
