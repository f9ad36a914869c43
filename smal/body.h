// A body in plain numbers: its pose, its shape, and its place before the camera of the crop.
#pragma once

#include <array>

#include "smal/camera.h"
#include "smal/sizes.h"

namespace q3d::smal {

// All joints are in SMAL's order, joint 0 carries the global orientation, and all arrays are row-major.
using Pose = std::array<float, kNumJoints * 9>;           // (35, 3, 3): rotation matrices
using AxisAnglePose = std::array<float, kNumJoints * 3>;  // (35, 3) rad: as annotation files state it
using Betas = std::array<float, kNumBetas>;               // shape coefficients
// Both are in SMAL units (about metres), in the axes of the crop's camera: x right, y down, z forward.
using Translation = std::array<float, 3>;
using Keypoints3d = std::array<float, kNumKeypoints * 3>;  // (26, 3), before the translation is added

// A body without a pose or shape of its own holds zeros there. Its camera is NaN if it has none.
struct Body {
  Pose pose{};
  Betas betas{};
  Camera camera{};
  Translation translation{};
};

}  // namespace q3d::smal
