#include "pipeline/world/bodies.h"

#include "pipeline/animal/synthetic_quadruped.h"
#include "pipeline/animal/synthetic_shapes.h"
#include "pipeline/world/shape_space.h"
#include "smal/tensors/body.h"
#include "smal/tensors/rotation.h"

namespace q3d::pipeline::world {
namespace {

RestMesh rest_of(const smal::tensors::SmalAsset& asset) {
  RestMesh rest;
  const auto vertices = asset.v_template.accessor<float, 2>();
  const auto faces = asset.faces.accessor<std::int32_t, 2>();
  const auto weights = asset.lbs_weights.accessor<float, 2>();
  for (std::int64_t v = 0; v < vertices.size(0); ++v) {
    rest.vertices.emplace_back(vertices[v][0], vertices[v][1], vertices[v][2]);
    auto& row = rest.skinning.emplace_back();
    for (std::int64_t joint = 0; joint < smal::kNumJoints; ++joint) {
      row[static_cast<std::size_t>(joint)] = weights[v][joint];
    }
  }
  for (std::int64_t f = 0; f < faces.size(0); ++f) {
    rest.triangles.push_back({static_cast<std::uint32_t>(faces[f][0]),
                              static_cast<std::uint32_t>(faces[f][1]),
                              static_cast<std::uint32_t>(faces[f][2])});
  }
  for (std::size_t k = 0; k < asset.keypoint_vertices.size(); ++k) {
    rest.keypoint_vertices.at(k).assign(asset.keypoint_vertices[k].begin(), asset.keypoint_vertices[k].end());
  }
  return rest;
}

ShapeSpace shapes_of(const RestMesh& rest, const smal::tensors::SmalAsset& asset) {
  using RowMajor = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const auto directions = asset.shapedirs.contiguous();
  const animal::ShapeSpace& space = animal::synthetic_shape_space();
  return {
      rest,
      Eigen::Map<const RowMajor>(directions.const_data_ptr<float>(), 3 * directions.size(0), smal::kNumBetas)
          .cast<double>(),
      space.family_means,
      {space.family_factors.begin(), space.family_factors.end()}};
}

}  // namespace

struct BodyModel::Model {
  smal::tensors::SmalBody body;
  RestMesh rest;
  ShapeSpace shapes;
  explicit Model(const smal::tensors::SmalAsset& asset)
      : body(asset), rest(rest_of(asset)), shapes(shapes_of(rest, asset)) {}
};

BodyModel::BodyModel() : model_(std::make_unique<Model>(animal::make_synthetic_quadruped())) {}
BodyModel::~BodyModel() = default;

const RestMesh& BodyModel::rest() const {
  return model_->rest;
}
const ShapeSpace& BodyModel::shapes() const {
  return model_->shapes;
}

void BodyModel::save(const std::filesystem::path& asset) const {
  smal::tensors::save_asset(asset, model_->body.asset());
}

std::vector<Body> BodyModel::pose(std::span<const Posture> postures) const {
  const c10::InferenceMode no_gradient;
  const auto count = static_cast<std::int64_t>(postures.size());
  auto pose = torch::empty({count, smal::kNumJoints, 3});
  auto betas = torch::empty({count, smal::kNumBetas});
  for (std::int64_t i = 0; i < count; ++i) {
    const Posture& posture = postures[static_cast<std::size_t>(i)];
    std::copy(posture.pose.begin(), posture.pose.end(),
              pose.mutable_data_ptr<float>() + i * 3 * smal::kNumJoints);
    std::copy(posture.betas.begin(), posture.betas.end(),
              betas.mutable_data_ptr<float>() + i * smal::kNumBetas);
  }
  const auto output = model_->body.forward(smal::tensors::axis_angle_to_matrix_exact(pose), betas);
  const auto vertices = output.vertices.contiguous();
  const auto keypoints = output.keypoints.contiguous();
  const auto* vertex = reinterpret_cast<const Eigen::Vector3f*>(vertices.const_data_ptr<float>());
  const auto* keypoint = reinterpret_cast<const Eigen::Vector3f*>(keypoints.const_data_ptr<float>());
  std::vector<Body> bodies(postures.size());
  for (Body& body : bodies) {
    body.vertices.assign(vertex, vertex + vertices.size(1));
    std::copy(keypoint, keypoint + smal::kNumKeypoints, body.keypoints.begin());
    vertex += vertices.size(1);
    keypoint += smal::kNumKeypoints;
  }
  return bodies;
}

}  // namespace q3d::pipeline::world
