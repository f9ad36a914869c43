// Distinguishes plausible poses and shapes from the network's. Paper's warm-up stage; official code:
// discriminator.py.
#pragma once

#include <torch/nn/module.h>
#include <torch/types.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "model/layers.h"

namespace q3d::model {

// One score for each of 34 joints, one for the betas and one for all joints together. Parameters have the
// official names; the official checkpoint's bone_* layers belong to no computation and are left out.
class Discriminator : public torch::nn::Module {
 public:
  explicit Discriminator(const Placement& placement = {});

  // rotations (B, 34, 3, 3) without the global orientation, betas (B, 41) -> (B, 36).
  torch::Tensor forward(const torch::Tensor& rotations, const torch::Tensor& betas) const;

 private:
  torch::Tensor conv1_weight_, conv1_bias_;  // (32, 9, 1, 1), (32): a convolution over single joints
  torch::Tensor conv2_weight_, conv2_bias_;  // (32, 32, 1, 1), (32)
  std::vector<std::shared_ptr<Linear>> pose_out_;
  std::shared_ptr<Linear> betas_fc1_, betas_fc2_, betas_out_;
  std::shared_ptr<Linear> joints_fc1_, joints_fc2_, joints_out_;
};

// Seeded weights: Xavier's uniform rule, biases zero.
void initialise(Discriminator& discriminator, std::uint64_t seed);

// sum((score - 1)^2) / B: what the network pays for scores (B, 36) of its own bodies.
torch::Tensor adversarial_loss(const torch::Tensor& scores_of_predicted);

// sum(score^2) / B of the network's bodies plus sum((score - 1)^2) / B of the true ones, counting only
// samples whose flag `is_real` (B) is 1.
torch::Tensor discriminator_loss(const torch::Tensor& scores_of_predicted,
                                 const torch::Tensor& scores_of_true, const torch::Tensor& is_real);

}  // namespace q3d::model
