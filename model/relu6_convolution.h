// A convolution followed by ReLU6 (min(max(x, 0), 6)), computed in one pass over the maps.
//
// On CPUs with AVX-512, in float32 and bfloat16, oneDNN clamps each number before it stores it. Two operators
// one after the other read and write the maps once more. Elsewhere these functions are LibTorch's two
// operators. The values have the same bits in both ways.
#pragma once

#include <torch/types.h>

#include "model/depthwise.h"

namespace q3d::model {

// Zeros round a result: `before` of them left of it and above it, `after` right of it and below it.
struct Frame {
  std::int64_t before = 0;
  std::int64_t after = 0;
};

// maps (B, C, H, W), weight (C', C, side, side) or, for a depthwise convolution, (C, 1, side, side), bias
// (C'), all of one dtype -> (B, C', H', W'). A convolution of 1 x 1 pixels can give its result the frame that
// the next convolution needs: it pads its own maps, which are narrower than its result. On a CPU, the
// gradients of a depthwise convolution in float32 and bfloat16 are those of model/depthwise.h; all others are
// LibTorch's. Throws std::invalid_argument on a frame round another convolution.
torch::Tensor relu6_convolution(const torch::Tensor& maps, const torch::Tensor& weight,
                                const torch::Tensor& bias, const ConvolutionShape& shape,
                                const Frame& frame = {});

}  // namespace q3d::model
