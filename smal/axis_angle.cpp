#include "smal/axis_angle.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace q3d::smal {
namespace {

Eigen::Matrix3d rotation_matrix(const Eigen::Vector3d& axis_angle) {
  const double angle_rad = axis_angle.norm();
  if (angle_rad == 0.0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle_rad, axis_angle / angle_rad).toRotationMatrix();
}

}  // namespace

Pose rotation_matrices(const AxisAnglePose& axis_angle) {
  Pose matrices{};
  for (std::size_t joint = 0; joint < kNumJoints; ++joint) {
    const float* turn = &axis_angle[3 * joint];
    const Eigen::Matrix<float, 3, 3, Eigen::RowMajor> matrix =
        rotation_matrix({turn[0], turn[1], turn[2]}).cast<float>();
    std::copy_n(matrix.data(), 9, &matrices[9 * joint]);
  }
  return matrices;
}

std::array<double, kNumJoints * 3> axis_angles(const Pose& matrices) {
  std::array<double, kNumJoints * 3> vectors{};
  for (std::size_t joint = 0; joint < kNumJoints; ++joint) {
    const Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>> matrix(&matrices[9 * joint]);
    Eigen::Quaterniond quaternion(Eigen::Matrix3d(matrix.cast<double>()));
    quaternion.normalize();  // float32 matrices are rotations up to rounding
    const Eigen::AngleAxisd turn(quaternion);
    const Eigen::Vector3d vector = turn.angle() * turn.axis();
    std::copy_n(vector.data(), 3, &vectors[3 * joint]);
  }
  return vectors;
}

}  // namespace q3d::smal
