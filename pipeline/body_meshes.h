// The body model alone: bodies posed for measurement, without the network. Keeps LibTorch out of its callers.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "filters/guard_measures.h"
#include "manifests/sample.h"

namespace q3d::pipeline {

// What determines a body up to its place: rotations are row-major 3x3 matrices, joint 0 is the global
// orientation.
struct BodyShape {
  std::array<float, manifests::kNumJoints * 9> rotations{};
  std::array<float, manifests::kNumBetas> betas{};
};

struct BodyMesh {
  std::vector<float> vertices;                                     // V x 3, SMAL units
  std::array<float, manifests::kNumKeypoints * 3> keypoints_3d{};  // 26 x 3, SMAL units
  std::array<float, manifests::kNumJoints * 3> joints{};           // 35 x 3, SMAL units
};

// The numbers of a file of priors (model/priors.h).
struct PriorNumbers {
  filters::PosePrior pose;
  std::vector<std::array<float, manifests::kNumBetas>> family_betas;  // the families' mean shapes
};
// Throws std::runtime_error naming file and tensor.
PriorNumbers read_priors(const std::filesystem::path& path);

// 35 axis-angles (rad) to 35 row-major matrices by the exact Rodrigues formula. Official evaluator:
// pytorch3d's axis_angle_to_matrix.
std::array<float, manifests::kNumJoints * 9> rotation_matrices(
    const std::array<float, manifests::kNumJoints * 3>& axis_angle);

// Runs on the CPU, in float32, with as many threads as the calling thread has been given.
class BodyMeshes {
 public:
  // compute_threads: of the calling thread's operators from now on; 0 leaves them as they are. Throws
  // std::runtime_error.
  explicit BodyMeshes(const std::filesystem::path& smal_asset, int compute_threads = 0);
  ~BodyMeshes();
  BodyMeshes(const BodyMeshes&) = delete;
  BodyMeshes& operator=(const BodyMeshes&) = delete;

  // Triangles of every mesh: three vertices each.
  std::vector<std::array<std::int32_t, 3>> faces() const;

  // Meshes of the bodies, without translation.
  std::vector<BodyMesh> pose(std::span<const BodyShape> bodies) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace q3d::pipeline
