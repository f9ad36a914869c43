// The SMAL body as a differentiable function of pose, betas and translation.
#pragma once

#include <torch/types.h>

#include <memory>

#include "smal/tensors/asset.h"

namespace q3d::smal::tensors {

struct BodyOutput {
  torch::Tensor vertices;   // (B, V, 3); undefined when only keypoints were asked for
  torch::Tensor keypoints;  // (B, 26, 3): means of fixed vertex groups of the posed mesh
  torch::Tensor joints;     // (B, 35, 3): posed kinematic joints
};

// Linear blend skinning with shape and pose blend shapes (smplx.lbs with pose2rot = False; official code:
// smal_wrapper.SMAL.forward). Immutable after construction; forward is thread-safe.
class SmalBody {
 public:
  // Throws std::runtime_error if check_asset refuses the asset.
  explicit SmalBody(SmalAsset asset, torch::Device device = torch::kCPU);

  // Returns the posed bodies. rotations: (B, 35, 3, 3); betas: (B, 41); transl: (B, 3) or undefined; all
  // float32 (or float64 after to_dtype). Throws std::invalid_argument for another shape.
  BodyOutput forward(const torch::Tensor& rotations, const torch::Tensor& betas,
                     const torch::Tensor& transl = {}) const;

  // Returns the 26 keypoints alone, (B, 26, 3), from the few vertices that they depend on. The numbers equal
  // forward().keypoints up to rounding, at a fraction of the cost.
  torch::Tensor keypoints(const torch::Tensor& rotations, const torch::Tensor& betas,
                          const torch::Tensor& transl = {}) const;

  const SmalAsset& asset() const { return asset_; }
  torch::Device device() const { return asset_.v_template.device(); }
  SmalBody to(torch::Device device) const;
  SmalBody to_dtype(torch::ScalarType dtype) const;

 private:
  struct Rig;  // the asset's tensors in the form that the arithmetic needs
  SmalAsset asset_;
  std::shared_ptr<const Rig> rig_;
};

}  // namespace q3d::smal::tensors
