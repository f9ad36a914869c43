// The interface of the body model alone, which poses bodies for measurement. It needs neither the network nor
// LibTorch's headers.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "filters/guard_measures.h"
#include "smal/body.h"

namespace q3d::pipeline::device {

struct BodyMesh {
  std::vector<float> vertices;  // V x 3, SMAL units
  smal::Keypoints3d keypoints_3d{};
  std::array<float, smal::kNumJoints * 3> joints{};  // 35 x 3, SMAL units
};

// The numbers of a file of priors (model/priors.h).
struct PriorNumbers {
  filters::PosePrior pose;
  filters::ShapePrior shape;
  std::vector<smal::Betas> family_betas;  // the families' mean shapes
};

// A loaded body model. Runs on the CPU, in float32, with as many threads as the calling thread has been
// given. pipeline/network makes one.
class BodyMeshes {
 public:
  BodyMeshes() = default;
  BodyMeshes(const BodyMeshes&) = delete;
  BodyMeshes& operator=(const BodyMeshes&) = delete;
  virtual ~BodyMeshes() = default;

  // Returns the triangles of every mesh, each as three vertices.
  virtual std::vector<std::array<std::int32_t, 3>> faces() const = 0;

  // Returns the meshes of the bodies from their poses and betas. Their translations are not added.
  virtual std::vector<BodyMesh> pose(std::span<const smal::Body> bodies) const = 0;
};

// Loads the body model of an asset file. Throws std::runtime_error that names file and tensor.
using BodyMeshesLoader = std::function<std::unique_ptr<BodyMeshes>(const std::filesystem::path& smal_asset)>;

}  // namespace q3d::pipeline::device
