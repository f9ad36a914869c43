// The training losses. Paper section "Training Loss"; official code: losses.py and PRIMA.compute_loss.
//
// Keypoint and parameter losses are sums over the batch, not means, as in the official code: the learning
// rate belongs to a batch size. The others are means and keep sum and count apart.
#pragma once

#include <torch/types.h>

#include "model/partial_mean.h"
#include "model/prima.h"
#include "model/priors.h"
#include "model/ranks/collective.h"
#include "model/settings/loss_weights.h"

namespace q3d::model {

// The known truth of a batch. All tensors but `family` are float32, and flags are 0 or 1. If a flag is 0, its
// numbers are not used, but they must be finite.
struct Targets {
  torch::Tensor keypoints_2d;  // (B, 26, 3): x, y in crop units and a weight
  torch::Tensor keypoints_3d;  // (B, 26, 4): SMAL units in the camera's frame, and a weight
  torch::Tensor rotations;     // (B, 35, 3, 3), joint 0 = global orientation
  torch::Tensor betas;         // (B, 41)
  torch::Tensor has_pose;      // (B)
  torch::Tensor has_betas;     // (B)
  torch::Tensor family;        // (B) int64: row of the shape prior, -1 for none
};
// Throws std::invalid_argument naming the tensor, got and expected.
void check_targets(const Targets& targets);
Targets to_device(const Targets& targets, torch::Device device);

// Scalars on the prediction's device, with their graphs. With several ranks, values and gradients are scaled
// so that their mean over the ranks is that of the joint batch: sums and the sums of means are scaled by the
// number of ranks, counts are those of all ranks, and the contrastive loss is of all ranks' features.
struct LossTerms {
  torch::Tensor keypoints_2d, keypoints_3d;          // of the body
  torch::Tensor aux_keypoints_2d, aux_keypoints_3d;  // of the decoder's last keypoint tokens
  torch::Tensor global_orient, pose, betas;          // squared errors where there is truth
  PartialMean pose_prior, shape_prior, initial_shape_prior, contrastive;
};

LossTerms loss_terms(const Prediction& prediction, const Targets& targets, const Priors& priors,
                     settings::LossVariant variant, const ranks::Collective& ranks = *ranks::single_rank());

// The weighted sum without the adversarial term. The pose prior, halved, counts with the weights of the
// global orientation and of the pose; the shape priors with that of the betas, the one of the initial betas
// halved.
torch::Tensor total_loss(const LossTerms& terms, const settings::LossWeights& weights);

// Sum over keypoints and axes of weight * |predicted - true|. predicted (B, 26, D), target (B, 26, D + 1).
torch::Tensor keypoint_loss(const torch::Tensor& predicted, const torch::Tensor& target);
// The same between positions relative to keypoint 0.
torch::Tensor centred_keypoint_loss(const torch::Tensor& predicted, const torch::Tensor& target);

// Supervised contrastive loss (Khosla et al. 2020), temperature 0.1, base temperature 0.07, over two equal
// views of each feature, so that every anchor has a positive. Samples with label -1 take no part. features
// (B, D) of unit length, labels (B) int64. Official code: SupConLoss.
PartialMean contrastive_loss(const torch::Tensor& features, const torch::Tensor& labels);

}  // namespace q3d::model
