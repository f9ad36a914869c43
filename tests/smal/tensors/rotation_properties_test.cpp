// Properties that every rotation has, in float64.
#include <gtest/gtest.h>

#include <cmath>

#include "smal/tensors/rotation.h"
#include "tests/support/properties.h"

namespace q3d::smal::tensors {
namespace {

using testing::number_between;

// Below, nothing amplifies rounding (1e-16) by more than some 1e3.
constexpr double kTolerance = 1e-12;

// The official guard adds 1e-8 to each number of an axis-angle vector before it takes the length.
constexpr double kGuardTolerance = 3e-8;

double worst(const torch::Tensor& a, const torch::Tensor& b) {
  return (a - b).abs().max().item<double>();
}

torch::Tensor identity() {
  return torch::eye(3, torch::kFloat64);
}

torch::Tensor any_vector(int largest) {
  const auto entry = number_between(-largest, largest);
  return torch::tensor({*entry, *entry, *entry}, torch::kFloat64);
}

double length(const torch::Tensor& vector) {
  return vector.norm().item<double>();
}

// Two columns that are neither short nor nearly parallel: rounding is amplified by at most
// |second| / |its part across the first| < 100.
torch::Tensor any_rot6d() {
  const torch::Tensor first = any_vector(2);
  const torch::Tensor second = any_vector(2);
  RC_PRE(length(first) > 0.01);
  RC_PRE(length(torch::linalg_cross(first, second)) > 0.01 * length(first) * length(second));
  RC_PRE(length(second) > 0.01);
  return torch::cat({first, second});
}

// An axis-angle vector of at most half a turn less 0.01 rad.
torch::Tensor any_axis_angle() {
  return any_vector(1) * ((M_PI - 0.01) / std::sqrt(3.0));
}

void assert_is_rotation(const torch::Tensor& matrix) {
  RC_ASSERT(worst(torch::matmul(matrix.t(), matrix), identity()) < kTolerance);
  RC_ASSERT(std::abs(torch::linalg_det(matrix).item<double>() - 1.0) < kTolerance);
}

RC_GTEST_PROP(RotationProperties, SixNumbersGiveARotation, ()) {
  assert_is_rotation(rot6d_to_matrix(any_rot6d()));
}

RC_GTEST_PROP(RotationProperties, TheFirstColumnIsTheFirstVectorsDirection, ()) {
  const torch::Tensor rot6d = any_rot6d();
  const torch::Tensor first = rot6d.narrow(0, 0, 3);
  const torch::Tensor second = rot6d.narrow(0, 3, 3);
  const torch::Tensor matrix = rot6d_to_matrix(rot6d);
  RC_ASSERT(worst(matrix.select(1, 0) * length(first), first) < kTolerance);
  // The second column lies in the plane of both vectors, on the second one's side.
  RC_ASSERT(matrix.select(1, 1).dot(second).item<double>() > 0.0);
  RC_ASSERT(std::abs(matrix.select(1, 2).dot(second).item<double>()) < kTolerance);
}

RC_GTEST_PROP(RotationProperties, TheVectorsLengthsDoNotMatter, ()) {
  const torch::Tensor rot6d = any_rot6d();
  const double scale = *number_between(1, 100);
  RC_ASSERT(worst(rot6d_to_matrix(rot6d * scale), rot6d_to_matrix(rot6d)) < kTolerance);
}

RC_GTEST_PROP(RotationProperties, SixNumbersOfARotationGiveItBack, ()) {
  const torch::Tensor matrix = rot6d_to_matrix(any_rot6d());
  RC_ASSERT(worst(rot6d_to_matrix(matrix_to_rot6d(matrix)), matrix) < kTolerance);
}

RC_GTEST_PROP(RotationProperties, AxisAngleGivesARotationThatKeepsItsAxis, ()) {
  const torch::Tensor vector = any_vector(10);
  const torch::Tensor matrix = axis_angle_to_matrix_exact(vector);
  assert_is_rotation(matrix);
  RC_ASSERT(worst(torch::mv(matrix, vector), vector) < 10.0 * kTolerance);
  RC_ASSERT(worst(torch::matmul(matrix, axis_angle_to_matrix_exact(-vector)), identity()) < kTolerance);
}

RC_GTEST_PROP(RotationProperties, TheOfficialFormulaIsTheExactOneButForItsGuard, ()) {
  const torch::Tensor vector = any_vector(10);
  const torch::Tensor matrix = axis_angle_to_matrix(vector);
  assert_is_rotation(matrix);
  RC_ASSERT(worst(matrix, axis_angle_to_matrix_exact(vector)) < kGuardTolerance);
}

// Towards half a turn, 0.01 rad before it, the official inverse divides by sin(angle) = 0.01: rounding is
// amplified by 1 / 0.01^2.
RC_GTEST_PROP(RotationProperties, AxisAngleComesBackFromItsMatrix, ()) {
  const torch::Tensor vector = any_axis_angle();
  const torch::Tensor matrix = axis_angle_to_matrix_exact(vector);
  RC_ASSERT(worst(matrix_to_axis_angle_smooth(matrix), vector) < kTolerance);
  RC_PRE(length(vector) > 1e-3);  // below 1e-4 rad the official inverse takes sin(angle) for the angle
  RC_ASSERT(worst(matrix_to_axis_angle(matrix), vector) < 1e4 * kTolerance);
}

// Angles beyond half a turn come back as the shorter way round, which is the same rotation.
RC_GTEST_PROP(RotationProperties, TheMatrixOfTheVectorThatComesBackIsTheSame, ()) {
  const torch::Tensor matrix = axis_angle_to_matrix_exact(any_vector(10));
  const torch::Tensor vector = matrix_to_axis_angle_smooth(matrix);
  RC_ASSERT(length(vector) <= M_PI + kTolerance);
  RC_ASSERT(worst(axis_angle_to_matrix_exact(vector), matrix) < kTolerance);
}

}  // namespace
}  // namespace q3d::smal::tensors
