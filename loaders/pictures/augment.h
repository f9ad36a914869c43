// Training augmentation: how it is drawn, and its effect on boxes, 3D keypoints and the global orientation.
//
// Official code: do_augmentation and get_example. In that code, the mirror flip and the extreme crop crash
// and are off in every released configuration. This file does not offer the extreme crop. The mirror is our
// own (loaders/keypoints/mirror.h) and off by default.
#pragma once

#include <array>
#include <random>

#include "loaders/pictures/crop.h"
#include "manifests/sample.h"
#include "smal/body.h"

namespace q3d::loaders::pictures {

struct AugmentOptions {        // the official configuration's values
  double scale = 0.3;          // box side times 1 +- this
  double rotation_deg = 30.0;  // standard deviation, cut at two of them
  double rotation_rate = 0.6;  // fraction of samples that are rotated
  double shift = 0.02;         // share of the box side, for each axis
  double colour = 0.2;         // each channel times 1 +- this
  double mirror_rate = 0.0;    // fraction of samples that are mirrored left to right
};

struct Augmentation {
  double scale = 1.0;         // > 1 shows more of the surroundings
  double rotation_deg = 0.0;  // rotation of the box in the image; the patch's content turns the other way
  double shift_x = 0.0;       // as a share of the unscaled box side
  double shift_y = 0.0;
  std::array<double, 3> colour{1.0, 1.0, 1.0};  // R, G, B; for normalise_patch
  bool mirror = false;                          // the patch is mirrored, after everything else
};

// Draws from the official distributions: normal numbers cut at +-1 for shift and scale and at +-2 for
// rotation, and uniform colour. The sequence depends only on the state of the engine, not on the
// distributions of the standard library.
Augmentation draw_augmentation(const AugmentOptions& options, std::mt19937_64& engine);

// Returns the map from image px to patch px under an augmentation, for warp_patch and keypoints_to_crop. A
// mirrored patch is mirrored about the principal point of the crop camera, px 128.
Affine augmented_patch_from_image(const SquareBox& box, const Augmentation& augmentation);

// Rotates 3D keypoints (x, y, z) by -rotation_deg about the camera's z axis, in float32. Official code:
// keypoint_3d_processing.
smal::Keypoints3d rotate_keypoints_3d(const smal::Keypoints3d& keypoints, double rotation_deg);

// Rotates an axis-angle orientation (rad) by -rotation_deg about the camera's z axis. The angle of the result
// lies in [0, pi], also for rotation 0. Official code: rot_aa.
std::array<float, 3> rotate_global_orient(const std::array<float, 3>& axis_angle, double rotation_deg);

}  // namespace q3d::loaders::pictures
