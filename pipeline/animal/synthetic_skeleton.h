// Defines joints, skinning and keypoints of the synthetic quadruped by places on its mesh.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "pipeline/animal/synthetic_mesh.h"
#include "smal/sizes.h"

namespace q3d::pipeline::animal {

struct JointSpec {
  const char* name;
  std::int32_t parent;
  Part part;     // the part of the mesh that the joint moves
  double ring;   // position of the joint along the part
  double blend;  // rings on either side over which its weight replaces that of the previous joint of the part
};

// Returns SMAL's 35 joints, parents before children. The root is at the hips.
const std::array<JointSpec, smal::kNumJoints>& synthetic_joints();

// Returns (35, V): each joint is a weighted mean of the mesh rings around it. Rows are non-negative and sum
// to 1.
Eigen::MatrixXd joint_regressor(const QuadrupedMesh& mesh);

// Returns (V, 35). Rows are non-negative, sum to 1 and vary smoothly over the mesh.
Eigen::MatrixXd skinning_weights(const QuadrupedMesh& mesh);

// Returns the 26 groups of vertices in the order of the datasets' keypoints.
std::vector<std::vector<std::int64_t>> keypoint_groups(const QuadrupedMesh& mesh);

}  // namespace q3d::pipeline::animal
