#include "smal/tensors/rotation.h"

#include "smal/tensors/tensor_check.h"

namespace q3d::smal::tensors {
namespace {

using torch::indexing::Ellipsis;
using torch::indexing::Slice;

// Returns the length along the last axis, at least `floor`. The axis is kept with size 1.
torch::Tensor length(const torch::Tensor& vectors, double floor = 0.0) {
  return torch::linalg_vector_norm(vectors, 2, {-1}, true).clamp_min(floor);
}

// Converts unit quaternions (..., 4), in the order (w, x, y, z), to matrices (..., 3, 3).
torch::Tensor quaternion_to_matrix(const torch::Tensor& quaternion) {
  const auto parts = quaternion.unbind(-1);
  const torch::Tensor &w = parts[0], &x = parts[1], &y = parts[2], &z = parts[3];
  const torch::Tensor ww = w * w, xx = x * x, yy = y * y, zz = z * z;
  const torch::Tensor rows = torch::stack({ww + xx - yy - zz, 2 * (x * y - w * z), 2 * (w * y + x * z),  //
                                           2 * (w * z + x * y), ww - xx + yy - zz, 2 * (y * z - w * x),  //
                                           2 * (x * z - w * y), 2 * (w * x + y * z), ww - xx - yy + zz},
                                          -1);
  return rows.unflatten(-1, {3, 3});
}

// Returns twice the vector of the antisymmetric part of matrices: (..., 3, 3) -> (..., 3).
torch::Tensor antisymmetric_vector(const torch::Tensor& matrix) {
  const auto at = [&matrix](int row, int column) { return matrix.index({Ellipsis, row, column}); };
  return torch::stack({at(2, 1) - at(1, 2), at(0, 2) - at(2, 0), at(1, 0) - at(0, 1)}, -1);
}

// Converts matrices (..., 3, 3) to unit quaternions (..., 4), in the order (w, x, y, z) with w >= 0. Each row
// of 4 q q^T is a multiple of q; the row with the largest diagonal element is at least 1 long, so its
// normalisation is smooth.
torch::Tensor matrix_to_quaternion(const torch::Tensor& matrix) {
  const auto at = [&matrix](int row, int column) { return matrix.index({Ellipsis, row, column}); };
  const torch::Tensor xx = at(0, 0), yy = at(1, 1), zz = at(2, 2);
  const torch::Tensor wx = at(2, 1) - at(1, 2), wy = at(0, 2) - at(2, 0), wz = at(1, 0) - at(0, 1);
  const torch::Tensor xy = at(1, 0) + at(0, 1), xz = at(0, 2) + at(2, 0), yz = at(2, 1) + at(1, 2);
  const torch::Tensor products = torch::stack({1 + xx + yy + zz, wx, wy, wz,  //
                                               wx, 1 + xx - yy - zz, xy, xz,  //
                                               wy, xy, 1 - xx + yy - zz, yz,  //
                                               wz, xz, yz, 1 - xx - yy + zz},
                                              -1)
                                     .unflatten(-1, {4, 4});
  const torch::Tensor longest = products.diagonal(0, -2, -1).argmax(-1, true).unsqueeze(-1);
  const torch::Tensor row = products.take_along_dim(longest, -2).squeeze(-2);
  const torch::Tensor quaternion = row / length(row);
  return torch::where(quaternion.select(-1, 0).unsqueeze(-1) < 0, -quaternion, quaternion);
}

}  // namespace

torch::Tensor rot6d_to_matrix(const torch::Tensor& rot6d) {
  expect_trailing(rot6d, "rot6d_to_matrix", "rot6d", {6});
  constexpr double kShortest = 1e-12;  // zero vectors stay zero instead of turning into NaN
  const torch::Tensor first = rot6d.index({Ellipsis, Slice(0, 3)});
  const torch::Tensor second = rot6d.index({Ellipsis, Slice(3, 6)});
  const torch::Tensor column1 = first / length(first, kShortest);
  const torch::Tensor across = second - (column1 * second).sum(-1, true) * column1;
  const torch::Tensor column2 = across / length(across, kShortest);
  return torch::stack({column1, column2, torch::linalg_cross(column1, column2)}, -1);
}

torch::Tensor matrix_to_rot6d(const torch::Tensor& matrix) {
  expect_trailing(matrix, "matrix_to_rot6d", "matrix", {3, 3});
  return torch::cat({matrix.select(-1, 0), matrix.select(-1, 1)}, -1);
}

torch::Tensor axis_angle_to_matrix(const torch::Tensor& axis_angle) {
  expect_trailing(axis_angle, "axis_angle_to_matrix", "axis_angle", {3});
  // The shift is the official code's guard against a zero angle: the axis is then not quite of unit length,
  // which the normalisation of the quaternion takes back.
  const torch::Tensor angle = length(axis_angle + 1e-8);
  const torch::Tensor axis = axis_angle / angle;
  const torch::Tensor half = 0.5 * angle;
  const torch::Tensor quaternion = torch::cat({half.cos(), half.sin() * axis}, -1);
  return quaternion_to_matrix(quaternion / length(quaternion));
}

torch::Tensor axis_angle_to_matrix_exact(const torch::Tensor& axis_angle) {
  expect_trailing(axis_angle, "axis_angle_to_matrix_exact", "axis_angle", {3});
  // R = I + (sin t / t) K + ((1 - cos t) / t^2) K^2 with K the cross-product matrix. torch's sinc is smooth
  // at 0, and (1 - cos t) / t^2 = (sin(t/2) / (t/2))^2 / 2 has no cancellation, so small angles need no
  // special case.
  const torch::Tensor angle = length(axis_angle).unsqueeze(-1);
  const torch::Tensor first = torch::sinc(angle / M_PI);
  const torch::Tensor second = 0.5 * torch::sinc(angle / (2.0 * M_PI)).square();
  const auto parts = axis_angle.unbind(-1);
  const torch::Tensor &x = parts[0], &y = parts[1], &z = parts[2];
  const torch::Tensor zero = torch::zeros_like(x);
  const torch::Tensor cross = torch::stack({zero, -z, y, z, zero, -x, -y, x, zero}, -1).unflatten(-1, {3, 3});
  return torch::eye(3, axis_angle.options()) + first * cross + second * torch::matmul(cross, cross);
}

torch::Tensor matrix_to_axis_angle(const torch::Tensor& matrix) {
  expect_trailing(matrix, "matrix_to_axis_angle", "matrix", {3, 3});
  const torch::Tensor trace = matrix.diagonal(0, -2, -1).sum(-1, true);
  const torch::Tensor angle = ((trace - 1.0) / 2.0).clamp(-1.0, 1.0).acos();
  const torch::Tensor doubled = antisymmetric_vector(matrix);
  const torch::Tensor general = doubled / (2.0 * angle.sin()).clamp_min(1e-6) * angle;
  return torch::where(angle < 1e-4, 0.5 * doubled, general);
}

torch::Tensor matrix_to_axis_angle_smooth(const torch::Tensor& matrix) {
  expect_trailing(matrix, "matrix_to_axis_angle_smooth", "matrix", {3, 3});
  const torch::Tensor quaternion = matrix_to_quaternion(matrix);
  const torch::Tensor cosine = quaternion.index({Ellipsis, Slice(0, 1)});
  const torch::Tensor sine_axis = quaternion.index({Ellipsis, Slice(1, 4)});
  const torch::Tensor squared = sine_axis.square().sum(-1, true);
  // For small angles, angle / sin(angle / 2) comes from its series, because the quotient's gradient would
  // divide zero by zero.
  const torch::Tensor is_small = squared < 1e-4;
  const torch::Tensor sine = torch::where(is_small, torch::ones_like(squared), squared).sqrt();
  const torch::Tensor quotient = 2.0 * torch::atan2(sine, cosine) / sine;
  const torch::Tensor series = 2.0 + squared * (1.0 / 3.0 + squared * (3.0 / 20.0));
  return sine_axis * torch::where(is_small, series, quotient);
}

}  // namespace q3d::smal::tensors
