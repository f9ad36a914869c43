#include "pipeline/network/torch_bodies.h"

#include <torch/types.h>

#include <algorithm>

#include "model/device.h"
#include "model/priors.h"
#include "pipeline/device/domain.h"
#include "smal/tensors/body.h"
#include "smal/tensors/safetensors.h"

namespace q3d::pipeline::network {
namespace {

constexpr std::size_t kBatch = 32;  // bounds the memory of skinning to some 20 MB

std::vector<device::BodyMesh> to_meshes(const smal::tensors::BodyOutput& output) {
  const torch::Tensor vertices = output.vertices.contiguous();
  const torch::Tensor keypoints = output.keypoints.contiguous();
  const torch::Tensor joints = output.joints.contiguous();
  const std::int64_t numbers = vertices[0].numel();
  std::vector<device::BodyMesh> meshes(static_cast<std::size_t>(vertices.size(0)));
  const float* vertex = vertices.data_ptr<float>();
  const float* keypoint = keypoints.data_ptr<float>();
  const float* joint = joints.data_ptr<float>();
  for (device::BodyMesh& mesh : meshes) {
    mesh.vertices.assign(vertex, vertex + numbers);
    std::copy_n(keypoint, mesh.keypoints_3d.size(), mesh.keypoints_3d.begin());
    std::copy_n(joint, mesh.joints.size(), mesh.joints.begin());
    vertex += numbers;
    keypoint += mesh.keypoints_3d.size();
    joint += mesh.joints.size();
  }
  return meshes;
}

class TorchBodyMeshes : public device::BodyMeshes {
 public:
  explicit TorchBodyMeshes(smal::tensors::SmalAsset asset) : body_(std::move(asset)) {}
  std::vector<std::array<std::int32_t, 3>> faces() const override;
  std::vector<device::BodyMesh> pose(std::span<const smal::Body> bodies) const override;

 private:
  smal::tensors::SmalBody body_;
};

std::vector<std::array<std::int32_t, 3>> TorchBodyMeshes::faces() const {
  const torch::Tensor faces = body_.asset().faces.to(torch::kInt32).contiguous();
  std::vector<std::array<std::int32_t, 3>> triangles(static_cast<std::size_t>(faces.size(0)));
  const std::int32_t* corner = faces.data_ptr<std::int32_t>();
  for (auto& triangle : triangles) {
    std::copy_n(corner, 3, triangle.begin());
    corner += 3;
  }
  return triangles;
}

std::vector<device::BodyMesh> TorchBodyMeshes::pose(std::span<const smal::Body> bodies) const {
  const at::NoGradGuard no_gradients;
  std::vector<device::BodyMesh> meshes;
  meshes.reserve(bodies.size());
  for (std::size_t first = 0; first < bodies.size(); first += kBatch) {
    const auto batch = bodies.subspan(first, std::min(kBatch, bodies.size() - first));
    const auto count = static_cast<std::int64_t>(batch.size());
    torch::Tensor rotations = torch::empty({count, smal::kNumJoints, 3, 3}, torch::kFloat32);
    torch::Tensor betas = torch::empty({count, smal::kNumBetas}, torch::kFloat32);
    float* rotation = rotations.data_ptr<float>();
    float* beta = betas.data_ptr<float>();
    for (const smal::Body& body : batch) {
      rotation = std::copy(body.pose.begin(), body.pose.end(), rotation);
      beta = std::copy(body.betas.begin(), body.betas.end(), beta);
    }
    for (device::BodyMesh& mesh : to_meshes(body_.forward(rotations, betas)))
      meshes.push_back(std::move(mesh));
  }
  return meshes;
}

}  // namespace

std::unique_ptr<device::BodyMeshes> load_body_meshes(const std::filesystem::path& smal_asset) {
  return std::make_unique<TorchBodyMeshes>(smal::tensors::load_asset(smal_asset));
}

bool is_synthetic_body(const std::filesystem::path& smal_asset) {
  const smal::tensors::SafeTensors file = smal::tensors::SafeTensors::open(smal_asset);
  const auto name = file.metadata().find("name");
  return name != file.metadata().end() && name->second == device::kSyntheticBodyName;
}

void use_compute_threads(int threads) {
  model::configure_compute(threads);
}

bool has_priors(const std::filesystem::path& path) {
  const smal::tensors::SafeTensors file = smal::tensors::SafeTensors::open(path);
  return file.contains("pose_prior_loss.mean_pose") && file.contains("shape_prior_loss.mean_betas");
}

device::PriorNumbers read_priors(const std::filesystem::path& path) {
  const model::Priors priors = model::load_priors(smal::tensors::SafeTensors::open(path), torch::kCPU);
  const auto numbers = [](const torch::Tensor& tensor) {
    const torch::Tensor wide = tensor.to(torch::kFloat64).contiguous();
    return std::vector<double>(wide.data_ptr<double>(), wide.data_ptr<double>() + wide.numel());
  };
  device::PriorNumbers result{
      {numbers(priors.mean_pose), numbers(priors.precs), numbers(priors.use_index)}, {}, {}};
  for (std::int64_t i = 0; i < priors.mean_betas.size(0); ++i) {
    result.shape.families.push_back({numbers(priors.mean_betas[i]), numbers(priors.betas_prec[i])});
  }
  const torch::Tensor betas = priors.mean_betas.contiguous();
  result.family_betas.resize(static_cast<std::size_t>(betas.size(0)));
  const float* number = betas.data_ptr<float>();
  for (auto& family : result.family_betas) {
    std::copy_n(number, family.size(), family.begin());
    number += family.size();
  }
  return result;
}

}  // namespace q3d::pipeline::network
