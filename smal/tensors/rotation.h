// Converts rotations between 6D, axis-angle and matrix forms, as the official code does.
#pragma once

#include <torch/types.h>

namespace q3d::smal::tensors {

// Converts (..., 6) to (..., 3, 3). The first three numbers give column 1 and the last three column 2, by
// Gram-Schmidt. Official code: geometry.rot6d_to_rotmat.
torch::Tensor rot6d_to_matrix(const torch::Tensor& rot6d);

// Converts (..., 3, 3) to (..., 6), the first two columns.
torch::Tensor matrix_to_rot6d(const torch::Tensor& matrix);

// Converts (..., 3) in rad to (..., 3, 3) through a quaternion. Official code: geometry.aa_to_rotmat.
torch::Tensor axis_angle_to_matrix(const torch::Tensor& axis_angle);

// Converts (..., 3) in rad to (..., 3, 3) by the exact Rodrigues formula, as the official evaluator does
// (pytorch3d's axis_angle_to_matrix).
torch::Tensor axis_angle_to_matrix_exact(const torch::Tensor& axis_angle);

// Converts (..., 3, 3) to (..., 3) in rad. Official code: losses.matrix_to_axis_angle. Its gradient is NaN at
// the identity.
torch::Tensor matrix_to_axis_angle(const torch::Tensor& matrix);

// Converts (..., 3, 3) to (..., 3) in rad through a quaternion, for training. It is exact up to and including
// half turns, and its gradient is finite everywhere, also at the identity.
torch::Tensor matrix_to_axis_angle_smooth(const torch::Tensor& matrix);

}  // namespace q3d::smal::tensors
