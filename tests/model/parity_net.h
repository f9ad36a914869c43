// The networks that the golden numbers were made with, and how near to the golden numbers one can come.
//
// The golden numbers were computed in float32, on another processor. We compute in float64, where rounding
// does not count and every processor gives the same, so that the difference is the golden numbers' own
// rounding. Some golden files state how large that is; where they do not, float32_noise tells.
#pragma once

#include <torch/types.h>

#include <functional>
#include <map>
#include <string>

#include "model/checkpoint.h"
#include "model/prima.h"
#include "smal/tensors/safetensors.h"

namespace q3d::testing {

using TensorMap = std::map<std::string, torch::Tensor>;

// Sizes of weights_<which>: what meta.config states, hidden widths from the tensors' shapes, the focal length
// from forward_<which>.
model::PrimaConfig parity_config(const std::string& which);

// The frozen network of weights_<which> with the golden body, on the CPU; dtype float32 or float64.
model::Prima parity_prima(const std::string& which, torch::ScalarType dtype = torch::kFloat32);
model::Prima parity_prima(const std::string& which, const model::PrimaConfig& config,
                          torch::ScalarType dtype = torch::kFloat32);
// The same without packed matrices, which cannot learn.
model::Prima learning_parity_prima(const std::string& which, const model::PrimaConfig& config,
                                   torch::ScalarType dtype);

smal::tensors::SafeTensors parity_file(const std::string& name);

// inputs.images_u8[index], through Prima::normalise.
torch::Tensor parity_images(const model::Prima& prima, const torch::Tensor& index);

// The largest relative change that rounding to float32 makes to a number.
inline constexpr double kFloat32Rounding = 0x1p-24;

// Returns how far float32 arithmetic may carry each tensor of `compute` from its exact value. Float32
// computes what exact arithmetic would give for slightly other weights, so the float64 network is run four
// times more with every weight moved by a random part of kFloat32Rounding. The result holds, for each tensor,
// the largest absolute change: one number for the whole tensor, but one a matrix for rotations (..., 3, 3),
// because a joint whose 6D columns are short or nearly parallel amplifies rounding more than its neighbours
// do. Shapes let the result be compared with the tensor.
TensorMap float32_noise(const std::string& which, const model::PrimaConfig& config,
                        const std::function<TensorMap(const model::Prima&)>& compute);

// Tolerances of golden numbers in units of float32_noise: float32 rounds the result of every operation and
// not just the weights.
inline constexpr double kNoiseFactor = 16.0;

// The same bound for our own float32 against float64. It is wide, because it must hold for every processor's
// order of summation.
inline constexpr double kFloat32Factor = 64.0;

// A few float32 roundings of the tensor's largest number: for what depends on no weight, or hardly.
torch::Tensor few_roundings(const torch::Tensor& tensor);

// Shapes first, then finite numbers, then the largest difference.
void expect_close(const std::string& name, const torch::Tensor& got, const torch::Tensor& expected,
                  double tolerance);
// The same with a tolerance for each element, which may be broadcast.
void expect_close(const std::string& name, const torch::Tensor& got, const torch::Tensor& expected,
                  const torch::Tensor& tolerance);

}  // namespace q3d::testing
