// The synthetic quadruped moves by a linear model of its joint angles.
#pragma once

#include <Eigen/Core>
#include <random>

#include "smal/sizes.h"

namespace q3d::pipeline::animal {

inline constexpr Eigen::Index kPoseSize = 3 * smal::kNumJoints;

// pose = mean + loadings z + spread * e with independent standard normal z and e, then kept within the
// limits. Angles are axis-angle components in rad: x rolls, y turns to the side, z pitches up or swings a leg
// forwards. The global orientation, components 0 to 2, is zero throughout.
struct MotionModel {
  Eigen::VectorXd mean;      // (105)
  Eigen::MatrixXd loadings;  // (105, motions)
  Eigen::VectorXd spread;    // (105)
  Eigen::VectorXd lower;     // (105)
  Eigen::VectorXd upper;     // (105)
};

MotionModel synthetic_motion();

// Returns standard normal numbers within +-2.5, the same on every platform.
Eigen::VectorXd bounded_normals(Eigen::Index count, std::mt19937_64& random);

Eigen::VectorXd sample_motion(const MotionModel& model, std::mt19937_64& random);

}  // namespace q3d::pipeline::animal
