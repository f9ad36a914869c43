// Rotations in plain numbers, for code that does not see LibTorch.
#pragma once

#include "smal/body.h"

namespace q3d::smal {

// Converts 35 axis-angle vectors (rad) to 35 row-major 3x3 matrices by Rodrigues' formula, computed in
// double. Official evaluator: pytorch3d's axis_angle_to_matrix.
Pose rotation_matrices(const AxisAnglePose& axis_angle);

// Converts 35 row-major rotation matrices to 35 axis-angle vectors (rad), computed in double by unit
// quaternions. The angles lie in [0, pi].
std::array<double, kNumJoints * 3> axis_angles(const Pose& matrices);

}  // namespace q3d::smal
