// Stores a module's parameters as named tensors and restores them, bit for bit.
#pragma once

#include <torch/nn/module.h>
#include <torch/types.h>

#include <string>

#include "smal/tensors/safetensors.h"

namespace q3d::model {

// Appends copies on the CPU, named `prefix` + the module's own name.
void append_parameters(smal::tensors::NamedTensors& state, const std::string& prefix,
                       const torch::nn::Module& module);

// Throws std::runtime_error naming the tensor, got and expected, when one is missing or of another shape or
// dtype; then the module may hold some of the new numbers.
void restore_parameters(const smal::tensors::SafeTensors& file, const std::string& prefix,
                        torch::nn::Module& module);

// file.tensor(name) with the shape and dtype of `like`, on its device. Throws as above.
torch::Tensor restored_like(const smal::tensors::SafeTensors& file, const std::string& name,
                            const torch::Tensor& like);

}  // namespace q3d::model
