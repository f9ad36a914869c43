// Rotations: 6D, axis-angle and matrix forms, as the official code computes them.
#pragma once

#include <torch/types.h>

namespace q3d::smal::tensors {

// (..., 6) -> (..., 3, 3). The first three numbers are column 1, the last three the unnormalised column 2.
// Official code: geometry.rot6d_to_rotmat.
torch::Tensor rot6d_to_matrix(const torch::Tensor& rot6d);

// (..., 3, 3) -> (..., 6): the first two columns.
torch::Tensor matrix_to_rot6d(const torch::Tensor& matrix);

// (..., 3) rad -> (..., 3, 3), by way of a quaternion. Official code: geometry.aa_to_rotmat.
torch::Tensor axis_angle_to_matrix(const torch::Tensor& axis_angle);

// (..., 3) rad -> (..., 3, 3) by the exact Rodrigues formula (small angles by series): what the official
// evaluator uses (pytorch3d's axis_angle_to_matrix).
torch::Tensor axis_angle_to_matrix_exact(const torch::Tensor& axis_angle);

// (..., 3, 3) -> (..., 3) rad. Official code: losses.matrix_to_axis_angle. Its gradient is NaN at the
// identity.
torch::Tensor matrix_to_axis_angle(const torch::Tensor& matrix);

// The same map by way of a quaternion: exact up to and including half turns, with a finite gradient
// everywhere, also at the identity. For training.
torch::Tensor matrix_to_axis_angle_smooth(const torch::Tensor& matrix);

}  // namespace q3d::smal::tensors
