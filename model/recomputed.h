// Saves memory in training: of a part of a network, only the input is kept, and the backward pass computes
// the part again (activation checkpointing, Chen et al. 2016). Official code: none; torch.utils.checkpoint
// does the same.
#pragma once

#include <torch/types.h>

#include <functional>
#include <vector>

namespace q3d::model {

// From (B, ...) to a tensor of any shape, with the gradients that are enabled.
using NetworkPart = std::function<torch::Tensor(const torch::Tensor&)>;

// Returns part(input). Output and gradients are bit for bit those of a plain call; the part is computed once
// more for the backward pass, with the same MixedPrecision and, if it draws from LibTorch's default generator
// of the input's device, with the same draws. `parameters` are all leaves that the part uses. Gradients of
// gradients are refused by LibTorch.
torch::Tensor recomputed(const NetworkPart& part, const torch::Tensor& input,
                         const std::vector<torch::Tensor>& parameters);

}  // namespace q3d::model
