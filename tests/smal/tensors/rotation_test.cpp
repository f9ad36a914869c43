#include "smal/tensors/rotation.h"

#include <gtest/gtest.h>

#include <cmath>

namespace q3d::smal::tensors {
namespace {

torch::Tensor vector3(double x, double y, double z) {
  return torch::tensor({x, y, z}, torch::kFloat64);
}

double worst(const torch::Tensor& a, const torch::Tensor& b) {
  return (a - b).abs().max().item<double>();
}

TEST(Rotation, QuarterTurnsByHand) {
  // A quarter turn about z takes x to y: columns are the images of the axes.
  const torch::Tensor expected =
      torch::tensor({0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0}, torch::kFloat64).view({3, 3});
  const torch::Tensor turn = vector3(0, 0, M_PI / 2);
  EXPECT_LT(worst(axis_angle_to_matrix_exact(turn), expected), 1e-15);
  EXPECT_LT(worst(axis_angle_to_matrix(turn), expected), 1e-7);
  EXPECT_LT(worst(matrix_to_axis_angle(expected), turn), 1e-12);
  const torch::Tensor rot6d = matrix_to_rot6d(expected);
  EXPECT_LT(worst(rot6d, torch::tensor({0.0, 1.0, 0.0, -1.0, 0.0, 0.0}, torch::kFloat64)), 1e-15);
  EXPECT_LT(worst(rot6d_to_matrix(rot6d), expected), 1e-15);
}

TEST(Rotation, ExactFormIsAccurateAtSmallAngles) {
  const torch::Tensor small = vector3(3e-9, -4e-9, 0);
  const torch::Tensor matrix = axis_angle_to_matrix_exact(small);
  // R - I = K to first order, and K^2 / 2 is below 1e-16.
  EXPECT_DOUBLE_EQ(matrix[0][2].item<double>(), -4e-9);
  EXPECT_DOUBLE_EQ(matrix[2][1].item<double>(), 3e-9);
  EXPECT_TRUE(torch::equal(axis_angle_to_matrix_exact(vector3(0, 0, 0)), torch::eye(3, torch::kFloat64)));
}

TEST(Rotation, ExactFormIsOrthogonalAndItsAngleIsRight) {
  at::manual_seed(3);
  const torch::Tensor axis_angle = 2.0 * torch::randn({50, 3}, torch::kFloat64);
  const torch::Tensor matrix = axis_angle_to_matrix_exact(axis_angle);
  EXPECT_LT(worst(torch::matmul(matrix, matrix.transpose(1, 2)), torch::eye(3, torch::kFloat64)), 1e-14);
  EXPECT_LT(worst(torch::det(matrix), torch::ones({50}, torch::kFloat64)), 1e-14);
  const torch::Tensor trace = matrix.diagonal(0, 1, 2).sum(1);
  EXPECT_LT(worst(trace, 1.0 + 2.0 * axis_angle.norm(2, 1).cos()), 1e-13);
  EXPECT_LT(worst(torch::matmul(matrix, axis_angle.unsqueeze(2)).squeeze(2), axis_angle), 1e-13);
}

TEST(Rotation, ExactFormHasAFiniteGradientAtZero) {
  torch::Tensor zero = torch::zeros({3}, torch::kFloat64).requires_grad_();
  axis_angle_to_matrix_exact(zero)[1][0].backward();
  EXPECT_LT(worst(zero.grad(), vector3(0, 0, 1)), 1e-15);
}

TEST(Rotation, SmoothLogarithmInvertsTheExactForm) {
  at::manual_seed(5);
  torch::Tensor axis = torch::randn({200, 3}, torch::kFloat64);
  axis = axis / axis.norm(2, 1, true);
  for (const double angle : {0.0, 1e-9, 1e-4, 0.0199, 0.0201, 1.0, 3.0, M_PI - 1e-3, M_PI - 1e-9}) {
    const torch::Tensor expected = angle * axis;
    const torch::Tensor got = matrix_to_axis_angle_smooth(axis_angle_to_matrix_exact(expected));
    EXPECT_LT(worst(got, expected), 1e-7 * std::max(angle, 1e-6)) << angle;
  }
}

TEST(Rotation, SmoothLogarithmHasItsTrueGradientAtTheIdentity) {
  // Near the identity the rotation vector is half the antisymmetric part of the matrix.
  const torch::Tensor identity = torch::eye(3, torch::kFloat64).requires_grad_();
  matrix_to_axis_angle_smooth(identity)[2].backward();
  const torch::Tensor expected =
      torch::tensor({0.0, -0.5, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0}, torch::kFloat64).view({3, 3});
  EXPECT_LT(worst(identity.grad(), expected), 1e-12);
  // The official form fails there, which is why training uses the other.
  const torch::Tensor again = torch::eye(3, torch::kFloat64).requires_grad_();
  matrix_to_axis_angle(again)[2].backward();
  EXPECT_TRUE(again.grad().isnan().any().item<bool>());
}

TEST(Rotation, SmoothLogarithmsGradientIsFiniteAtHalfTurns) {
  for (const int axis : {0, 1, 2}) {
    torch::Tensor turn = -torch::eye(3, torch::kFloat64);
    turn[axis][axis] = 1.0;
    turn.requires_grad_();
    matrix_to_axis_angle_smooth(turn).sum().backward();
    EXPECT_TRUE(turn.grad().isfinite().all().item<bool>());
  }
}

TEST(Rotation, Rot6dIgnoresLengthAndSkew) {
  const torch::Tensor rot6d = torch::tensor({2.0, 0.0, 0.0, 5.0, 3.0, 0.0}, torch::kFloat64);
  EXPECT_TRUE(torch::equal(rot6d_to_matrix(rot6d), torch::eye(3, torch::kFloat64)));
}

TEST(Rotation, AxisAngleGradientIsNanAtTheIdentityAsInTheOfficialCode) {
  torch::Tensor identity = torch::eye(3).requires_grad_();
  matrix_to_axis_angle(identity).sum().backward();
  EXPECT_TRUE(identity.grad().isnan().any().item<bool>());
}

TEST(Rotation, RefusesOtherShapes) {
  EXPECT_THROW(rot6d_to_matrix(torch::zeros({4, 5})), std::invalid_argument);
  EXPECT_THROW(rot6d_to_matrix(torch::zeros({4, 6}, torch::kInt32)), std::invalid_argument);
  EXPECT_THROW(axis_angle_to_matrix(torch::zeros({4})), std::invalid_argument);
  EXPECT_THROW(axis_angle_to_matrix_exact(torch::Tensor()), std::invalid_argument);
  EXPECT_THROW(matrix_to_axis_angle(torch::zeros({3})), std::invalid_argument);
  EXPECT_THROW(matrix_to_rot6d(torch::zeros({2, 3, 4})), std::invalid_argument);
}

}  // namespace
}  // namespace q3d::smal::tensors
