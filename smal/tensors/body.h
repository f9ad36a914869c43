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
  // Throws std::runtime_error when check_asset refuses the asset.
  explicit SmalBody(SmalAsset asset, torch::Device device = torch::kCPU);

  // rotations (B, 35, 3, 3), betas (B, 41), transl (B, 3) or undefined; float32 (or float64 after to_dtype).
  // Throws std::invalid_argument on another shape.
  BodyOutput forward(const torch::Tensor& rotations, const torch::Tensor& betas,
                     const torch::Tensor& transl = {}) const;

  // The 26 keypoints alone, from the few vertices that carry them: the same numbers as forward().keypoints to
  // rounding, at a fraction of the cost. (B, 26, 3).
  torch::Tensor keypoints(const torch::Tensor& rotations, const torch::Tensor& betas,
                          const torch::Tensor& transl = {}) const;

  const SmalAsset& asset() const { return asset_; }
  torch::Device device() const { return asset_.v_template.device(); }
  SmalBody to(torch::Device device) const;
  SmalBody to_dtype(torch::ScalarType dtype) const;

 private:
  struct Rig;  // what the asset's tensors look like to the arithmetic
  SmalAsset asset_;
  std::shared_ptr<const Rig> rig_;
};

}  // namespace q3d::smal::tensors
