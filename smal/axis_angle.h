// Rotations in plain numbers, for code that does not see LibTorch.
#pragma once

#include <array>

#include "smal/sizes.h"

namespace q3d::smal {

// 35 axis-angle vectors (rad) to 35 row-major 3x3 matrices by Rodrigues' formula, computed in double.
// Official evaluator: pytorch3d's axis_angle_to_matrix.
std::array<float, kNumJoints * 9> rotation_matrices(const std::array<float, kNumJoints * 3>& axis_angle);

}  // namespace q3d::smal
