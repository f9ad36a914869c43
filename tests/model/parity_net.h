// The networks that the golden numbers were made with.
#pragma once

#include <torch/torch.h>

#include <string>

#include "model/checkpoint.h"
#include "model/prima.h"
#include "smal/tensors/safetensors.h"

namespace q3d::testing {

// Sizes of weights_<which>: what meta.config states, hidden widths from the tensors' shapes, the focal length
// from forward_<which>.
model::PrimaConfig parity_config(const std::string& which);

// The frozen network of weights_<which> with the golden body, float32 on the CPU.
model::Prima parity_prima(const std::string& which);
model::Prima parity_prima(const std::string& which, const model::PrimaConfig& config,
                          torch::ScalarType dtype = torch::kFloat32);  // float64: the body too

smal::tensors::SafeTensors parity_file(const std::string& name);

// inputs.images_u8[index], through Prima::normalise.
torch::Tensor parity_images(const model::Prima& prima, const torch::Tensor& index);

// Shapes first, then finite numbers, then the largest difference.
void expect_close(const std::string& name, const torch::Tensor& got, const torch::Tensor& expected,
                  double tolerance);

}  // namespace q3d::testing
