// Joints, skinning and keypoints of the synthetic quadruped, all given by places on its mesh.
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
  double ring;   // where on it the joint lies
  double blend;  // rings on either side over which it takes over from the joint before it on the same part
};

// SMAL's 35 joints: parents before children, the root at the hips.
const std::array<JointSpec, smal::kNumJoints>& synthetic_joints();

// (35, V): each joint is a weighted mean of the mesh rings around it; rows are non-negative and sum to 1.
Eigen::MatrixXd joint_regressor(const QuadrupedMesh& mesh);

// (V, 35): rows are non-negative and sum to 1, smooth over the mesh.
Eigen::MatrixXd skinning_weights(const QuadrupedMesh& mesh);

// The 26 groups of vertices, in the order of the datasets' keypoints.
std::vector<std::vector<std::int64_t>> keypoint_groups(const QuadrupedMesh& mesh);

}  // namespace q3d::pipeline::animal
