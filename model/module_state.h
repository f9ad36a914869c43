// A module's parameters, and the random generators, as named tensors and back, bit for bit.
#pragma once

#include <torch/torch.h>

#include <string>

#include "smal/safetensors.h"

namespace q3d::model {

// Appends copies on the CPU, named `prefix` + the module's own name.
void append_parameters(smal::NamedTensors& state, const std::string& prefix, const torch::nn::Module& module);

// Throws std::runtime_error naming the tensor, got and expected, when one is missing or of another shape or
// dtype; then the module may hold some of the new numbers.
void restore_parameters(const smal::SafeTensors& file, const std::string& prefix, torch::nn::Module& module);

// file.tensor(name) with the shape and dtype of `like`, on its device. Throws as above.
torch::Tensor restored_like(const smal::SafeTensors& file, const std::string& name,
                            const torch::Tensor& like);

// LibTorch's default generators of the CPU and of `device`: what dropout and stochastic depth draw from.
void append_generators(smal::NamedTensors& state, const std::string& prefix, torch::Device device);
void restore_generators(const smal::SafeTensors& file, const std::string& prefix, torch::Device device);

}  // namespace q3d::model
