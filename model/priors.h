// Priors on pose and shape, for samples without 3D truth. Paper section "Parameter Losses"; official code:
// losses.PosePriorLoss and losses.ShapePriorLoss.
#pragma once

#include <torch/types.h>

#include <filesystem>

#include "model/partial_mean.h"
#include "smal/tensors/safetensors.h"

namespace q3d::model {

struct Priors {
  torch::Tensor mean_pose;   // (105) rad: the axis-angle vectors of 35 joints
  torch::Tensor precs;       // (105, 105): deviation @ precs has unit variance
  torch::Tensor use_index;   // (105) of 0 and 1: 0 for the global orientation
  torch::Tensor mean_betas;  // (families, 41)
  torch::Tensor betas_prec;  // (families, 41, 41): lower Cholesky factors of the inverse covariances
};

// Reads pose_prior_loss.* and shape_prior_loss.* of a checkpoint or of a file of priors. Throws
// std::runtime_error naming the tensor, got and expected.
Priors load_priors(const smal::tensors::SafeTensors& file, torch::Device device);
// Writes such a file. Throws std::runtime_error.
void save_priors(const std::filesystem::path& path, const Priors& priors);

// Per sample (B): the squares of the whitened pose, summed over its 105 numbers; those of the global
// orientation count as zeros. pose (B, 105) rad.
torch::Tensor pose_squares(const Priors& priors, const torch::Tensor& pose);
// Per sample (B): the squares of the whitened betas, summed over the 41, by the statistics of the nearest
// family. betas (B, 41).
torch::Tensor nearest_shape_squares(const Priors& priors, const torch::Tensor& betas);

// Mean square of the whitened pose over samples without true pose, the three numbers of the global
// orientation counted as zeros. pose (B, 105) rad, has_pose (B) of 0 and 1.
PartialMean pose_prior(const Priors& priors, const torch::Tensor& pose, const torch::Tensor& has_pose);

// Mean square of the whitened betas over samples without true betas, by the statistics of the sample's
// family. A sample of none of the families (-1) is measured by the nearest. betas (B, 41), family (B) int64,
// has_betas (B) of 0 and 1.
PartialMean shape_prior(const Priors& priors, const torch::Tensor& betas, const torch::Tensor& family,
                        const torch::Tensor& has_betas);

}  // namespace q3d::model
