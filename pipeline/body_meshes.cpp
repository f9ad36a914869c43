#include "pipeline/body_meshes.h"

#include <torch/torch.h>

#include <algorithm>

#include "model/device.h"
#include "model/priors.h"
#include "smal/body.h"
#include "smal/rotation.h"
#include "smal/safetensors.h"

namespace q3d::pipeline {
namespace {

constexpr std::size_t kBatch = 32;  // bounds the memory of skinning to some 20 MB

std::vector<BodyMesh> to_meshes(const smal::BodyOutput& output) {
  const torch::Tensor vertices = output.vertices.contiguous();
  const torch::Tensor keypoints = output.keypoints.contiguous();
  const torch::Tensor joints = output.joints.contiguous();
  const std::int64_t numbers = vertices[0].numel();
  std::vector<BodyMesh> meshes(static_cast<std::size_t>(vertices.size(0)));
  const float* vertex = vertices.data_ptr<float>();
  const float* keypoint = keypoints.data_ptr<float>();
  const float* joint = joints.data_ptr<float>();
  for (BodyMesh& mesh : meshes) {
    mesh.vertices.assign(vertex, vertex + numbers);
    std::copy_n(keypoint, mesh.keypoints_3d.size(), mesh.keypoints_3d.begin());
    std::copy_n(joint, mesh.joints.size(), mesh.joints.begin());
    vertex += numbers;
    keypoint += mesh.keypoints_3d.size();
    joint += mesh.joints.size();
  }
  return meshes;
}

}  // namespace

std::array<float, manifests::kNumJoints * 9> rotation_matrices(
    const std::array<float, manifests::kNumJoints * 3>& axis_angle) {
  torch::Tensor angles = torch::empty({manifests::kNumJoints, 3}, torch::kFloat32);
  std::copy(axis_angle.begin(), axis_angle.end(), angles.data_ptr<float>());
  const torch::Tensor matrices = smal::axis_angle_to_matrix_exact(angles).contiguous();
  std::array<float, manifests::kNumJoints * 9> result{};
  std::copy_n(matrices.data_ptr<float>(), result.size(), result.begin());
  return result;
}

struct BodyMeshes::Impl {
  smal::SmalBody body;
};

BodyMeshes::BodyMeshes(const std::filesystem::path& smal_asset, int compute_threads)
    : impl_(new Impl{smal::SmalBody(smal::load_asset(smal_asset))}) {
  if (compute_threads > 0) model::configure_compute(compute_threads);
}
BodyMeshes::~BodyMeshes() = default;

std::vector<std::array<std::int32_t, 3>> BodyMeshes::faces() const {
  const torch::Tensor faces = impl_->body.asset().faces.to(torch::kInt32).contiguous();
  std::vector<std::array<std::int32_t, 3>> triangles(static_cast<std::size_t>(faces.size(0)));
  const std::int32_t* corner = faces.data_ptr<std::int32_t>();
  for (auto& triangle : triangles) {
    std::copy_n(corner, 3, triangle.begin());
    corner += 3;
  }
  return triangles;
}

PriorNumbers read_priors(const std::filesystem::path& path) {
  const model::Priors priors = model::load_priors(smal::SafeTensors::open(path), torch::kCPU);
  const auto numbers = [](const torch::Tensor& tensor) {
    const torch::Tensor wide = tensor.to(torch::kFloat64).contiguous();
    return std::vector<double>(wide.data_ptr<double>(), wide.data_ptr<double>() + wide.numel());
  };
  PriorNumbers result{{numbers(priors.mean_pose), numbers(priors.precs), numbers(priors.use_index)}, {}};
  const torch::Tensor betas = priors.mean_betas.contiguous();
  result.family_betas.resize(static_cast<std::size_t>(betas.size(0)));
  const float* number = betas.data_ptr<float>();
  for (auto& family : result.family_betas) {
    std::copy_n(number, family.size(), family.begin());
    number += family.size();
  }
  return result;
}

std::vector<BodyMesh> BodyMeshes::pose(std::span<const BodyShape> bodies) const {
  const torch::NoGradGuard no_gradients;
  std::vector<BodyMesh> meshes;
  meshes.reserve(bodies.size());
  for (std::size_t first = 0; first < bodies.size(); first += kBatch) {
    const auto batch = bodies.subspan(first, std::min(kBatch, bodies.size() - first));
    const auto count = static_cast<std::int64_t>(batch.size());
    torch::Tensor rotations = torch::empty({count, manifests::kNumJoints, 3, 3}, torch::kFloat32);
    torch::Tensor betas = torch::empty({count, manifests::kNumBetas}, torch::kFloat32);
    float* rotation = rotations.data_ptr<float>();
    float* beta = betas.data_ptr<float>();
    for (const BodyShape& body : batch) {
      rotation = std::copy(body.rotations.begin(), body.rotations.end(), rotation);
      beta = std::copy(body.betas.begin(), body.betas.end(), beta);
    }
    for (BodyMesh& mesh : to_meshes(impl_->body.forward(rotations, betas))) meshes.push_back(std::move(mesh));
  }
  return meshes;
}

}  // namespace q3d::pipeline
