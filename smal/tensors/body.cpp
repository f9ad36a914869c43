#include "smal/tensors/body.h"

#include <algorithm>
#include <string>

#include "smal/tensors/tensor_check.h"

namespace q3d::smal::tensors {
namespace {

// A rigid motion x -> rotation x + translation for each joint.
struct JointMotion {
  torch::Tensor rotation;     // (B, 35, 3, 3)
  torch::Tensor translation;  // (B, 35, 3)
};

// The joints of each depth of the tree, and where their parents stand in the depth before. One pass over the
// depths (12 in SMAL's tree) replaces one over the joints.
struct TreeLevel {
  torch::Tensor joints;   // (n) int64
  torch::Tensor parents;  // (n) int64: joint numbers
  torch::Tensor slots;    // (n) int64: positions of the parents in the level before
};

struct KinematicTree {
  std::vector<TreeLevel> levels;  // without the root
  torch::Tensor order;            // (35) int64: joint -> position in the concatenated levels
};

KinematicTree make_tree(const torch::Tensor& parents, torch::Device device) {
  const torch::Tensor table = parents.to(torch::kCPU, torch::kInt64).contiguous();
  const std::vector<std::int64_t> parent(table.data_ptr<std::int64_t>(),
                                         table.data_ptr<std::int64_t>() + kNumJoints);
  const auto index = [device](const std::vector<std::int64_t>& numbers) {
    return torch::tensor(numbers, torch::kInt64).to(device);
  };
  KinematicTree tree;
  std::vector<std::int64_t> previous = {0};
  std::vector<std::int64_t> position(kNumJoints, 0);
  std::int64_t placed = 1;
  while (placed < kNumJoints) {
    std::vector<std::int64_t> joints, above, slots;
    for (std::int64_t joint = 1; joint < kNumJoints; ++joint) {
      const auto slot = std::find(previous.begin(), previous.end(), parent[joint]);
      if (slot == previous.end()) continue;
      joints.push_back(joint);
      above.push_back(parent[joint]);
      slots.push_back(slot - previous.begin());
      position[joint] = placed++;
    }
    tree.levels.push_back({index(joints), index(above), index(slots)});
    previous = joints;
  }
  tree.order = index(position);
  return tree;
}

// Returns the motion of each joint's frame from its rest position; its translation is the posed joint.
// joints: (B, 35, 3) at rest; rotations: (B, 35, 3, 3), relative to the parent.
JointMotion pose_tree(const KinematicTree& tree, const torch::Tensor& rotations,
                      const torch::Tensor& joints) {
  std::vector<torch::Tensor> level_rotations = {rotations.narrow(1, 0, 1)};
  std::vector<torch::Tensor> level_positions = {joints.narrow(1, 0, 1)};
  for (const TreeLevel& level : tree.levels) {
    const torch::Tensor parent_rotation = level_rotations.back().index_select(1, level.slots);
    const torch::Tensor parent_position = level_positions.back().index_select(1, level.slots);
    const torch::Tensor bone = joints.index_select(1, level.joints) - joints.index_select(1, level.parents);
    level_positions.push_back(torch::matmul(parent_rotation, bone.unsqueeze(-1)).squeeze(-1) +
                              parent_position);
    level_rotations.push_back(torch::matmul(parent_rotation, rotations.index_select(1, level.joints)));
  }
  return {torch::cat(level_rotations, 1).index_select(1, tree.order),
          torch::cat(level_positions, 1).index_select(1, tree.order)};
}

// The model's data for n vertices.
struct VertexSet {
  torch::Tensor rest;       // (n, 3)
  torch::Tensor shapedirs;  // (3 n, 41)
  torch::Tensor posedirs;   // (306, 3 n)
  torch::Tensor weights;    // (n, 35)
};

VertexSet all_vertices(const SmalAsset& asset) {
  return {asset.v_template, asset.shapedirs.flatten(0, 1), asset.posedirs, asset.lbs_weights};
}

VertexSet some_vertices(const SmalAsset& asset, const torch::Tensor& index) {
  return {asset.v_template.index_select(0, index), asset.shapedirs.index_select(0, index).flatten(0, 1),
          asset.posedirs.unflatten(1, {-1, 3}).index_select(1, index).flatten(1),
          asset.lbs_weights.index_select(0, index)};
}

// Applies the blend shapes and then skinning. Returns (B, n, 3).
torch::Tensor posed_vertices(const VertexSet& set, const torch::Tensor& pose_feature,
                             const torch::Tensor& betas, const JointMotion& skinning) {
  const std::int64_t batch = betas.size(0);
  const torch::Tensor offsets =
      torch::matmul(betas, set.shapedirs.t()) + torch::matmul(pose_feature, set.posedirs);
  const torch::Tensor shaped = set.rest + offsets.view({batch, -1, 3});
  const torch::Tensor rotation =
      torch::matmul(set.weights, skinning.rotation.flatten(2)).unflatten(2, {3, 3});
  const torch::Tensor translation = torch::matmul(set.weights, skinning.translation);
  return torch::matmul(rotation, shaped.unsqueeze(-1)).squeeze(-1) + translation;
}

// Returns every vertex that some keypoint needs, in ascending order.
std::vector<std::int64_t> used_vertices(const std::vector<std::vector<std::int64_t>>& groups) {
  std::vector<std::int64_t> used;
  for (const auto& group : groups) used.insert(used.end(), group.begin(), group.end());
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  return used;
}

// Returns a matrix (26, U) whose row k averages the vertices of group k. A vertex that is listed twice counts
// twice.
torch::Tensor group_means(const std::vector<std::vector<std::int64_t>>& groups,
                          const std::vector<std::int64_t>& used) {
  torch::Tensor means =
      torch::zeros({kNumKeypoints, static_cast<std::int64_t>(used.size())}, torch::kFloat64);
  auto entry = means.accessor<double, 2>();
  for (std::size_t k = 0; k < groups.size(); ++k) {
    for (const std::int64_t vertex : groups[k]) {
      const auto column = std::lower_bound(used.begin(), used.end(), vertex) - used.begin();
      entry[static_cast<std::int64_t>(k)][column] += 1.0 / static_cast<double>(groups[k].size());
    }
  }
  return means;
}

}  // namespace

struct SmalBody::Rig {
  KinematicTree tree;
  torch::Tensor joint_rest;       // (35, 3)
  torch::Tensor joint_shapedirs;  // (105, 41)
  VertexSet all;
  VertexSet used;                // the vertices of the keypoint groups
  torch::Tensor used_index;      // (U) int64
  torch::Tensor keypoint_means;  // (26, U)

  explicit Rig(const SmalAsset& asset) {
    const torch::Device device = asset.v_template.device();
    const auto dtype = asset.v_template.scalar_type();
    tree = make_tree(asset.parents, device);
    // These two sums over all vertices are computed in double, because they would otherwise carry the largest
    // rounding error.
    const torch::Tensor regressor = asset.j_regressor.to(torch::kFloat64);
    joint_rest = torch::matmul(regressor, asset.v_template.to(torch::kFloat64)).to(dtype);
    joint_shapedirs = torch::matmul(regressor, asset.shapedirs.to(torch::kFloat64).flatten(1))
                          .view({kNumJoints * 3, kNumBetas})
                          .to(dtype);
    const std::vector<std::int64_t> vertices = used_vertices(asset.keypoint_vertices);
    used_index = torch::tensor(vertices, torch::kInt64).to(device);
    keypoint_means = group_means(asset.keypoint_vertices, vertices).to(device, dtype);
    all = all_vertices(asset);
    used = some_vertices(asset, used_index);
  }

  // Returns the motion of each joint, and the same motion in the form that skinning needs, which starts from
  // the rest shape of these betas.
  std::pair<JointMotion, JointMotion> move_joints(const torch::Tensor& rotations,
                                                  const torch::Tensor& betas) const {
    const torch::Tensor joints =
        joint_rest + torch::matmul(betas, joint_shapedirs.t()).view({betas.size(0), kNumJoints, 3});
    JointMotion posed = pose_tree(tree, rotations, joints);
    const torch::Tensor carried = torch::matmul(posed.rotation, joints.unsqueeze(-1)).squeeze(-1);
    return {posed, {posed.rotation, posed.translation - carried}};
  }
};

namespace {

SmalAsset convert(SmalAsset asset, torch::Device device, torch::ScalarType dtype) {
  for (torch::Tensor* tensor :
       {&asset.v_template, &asset.shapedirs, &asset.posedirs, &asset.j_regressor, &asset.lbs_weights}) {
    *tensor = tensor->to(device, dtype);
  }
  asset.faces = asset.faces.to(device);
  asset.parents = asset.parents.to(device);
  return asset;
}

// Returns the rotations minus the identity, without the root: (B, 306).
torch::Tensor pose_feature(const torch::Tensor& rotations) {
  return (rotations.narrow(1, 1, kNumJoints - 1) - torch::eye(3, rotations.options())).flatten(1);
}

void check_arguments(const char* where, const torch::Tensor& rotations, const torch::Tensor& betas,
                     const torch::Tensor& transl) {
  expect_floating(rotations, where, "rotations", {kAnySize, kNumJoints, 3, 3});
  expect_floating(betas, where, "betas", {rotations.size(0), kNumBetas});
  if (transl.defined()) expect_floating(transl, where, "transl", {rotations.size(0), 3});
}

torch::Tensor moved(const torch::Tensor& points, const torch::Tensor& transl) {
  return transl.defined() ? points + transl.unsqueeze(1) : points;
}

}  // namespace

SmalBody::SmalBody(SmalAsset asset, torch::Device device) {
  check_asset(asset, "SmalBody");
  asset_ = convert(std::move(asset), device, torch::kFloat32);
  rig_ = std::make_shared<const Rig>(asset_);
}

BodyOutput SmalBody::forward(const torch::Tensor& rotations, const torch::Tensor& betas,
                             const torch::Tensor& transl) const {
  check_arguments("SmalBody::forward", rotations, betas, transl);
  const auto [posed, skinning] = rig_->move_joints(rotations, betas);
  BodyOutput output;
  output.vertices = moved(posed_vertices(rig_->all, pose_feature(rotations), betas, skinning), transl);
  output.keypoints = torch::matmul(rig_->keypoint_means, output.vertices.index_select(1, rig_->used_index));
  output.joints = moved(posed.translation, transl);
  return output;
}

torch::Tensor SmalBody::keypoints(const torch::Tensor& rotations, const torch::Tensor& betas,
                                  const torch::Tensor& transl) const {
  check_arguments("SmalBody::keypoints", rotations, betas, transl);
  const auto [posed, skinning] = rig_->move_joints(rotations, betas);
  const torch::Tensor vertices = posed_vertices(rig_->used, pose_feature(rotations), betas, skinning);
  return moved(torch::matmul(rig_->keypoint_means, vertices), transl);
}

SmalBody SmalBody::to(torch::Device device) const {
  SmalBody other(*this);
  other.asset_ = convert(asset_, device, asset_.v_template.scalar_type());
  other.rig_ = std::make_shared<const Rig>(other.asset_);
  return other;
}

SmalBody SmalBody::to_dtype(torch::ScalarType dtype) const {
  SmalBody other(*this);
  other.asset_ = convert(asset_, device(), dtype);
  other.rig_ = std::make_shared<const Rig>(other.asset_);
  return other;
}

}  // namespace q3d::smal::tensors
