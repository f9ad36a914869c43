// A depthwise convolution with gradients of our own.
//
// LibTorch computes the value fast. On a CPU, its gradients of maps in channels-last order take ten to sixty
// times as long as the value, and were the largest part of a training step of an EfficientNet stem.
#pragma once

#include <torch/types.h>

namespace q3d::model {

struct DepthwiseShape {
  std::int64_t side;    // of the square kernel, in pixels
  std::int64_t stride;  // 1 or 2
  std::int64_t before;  // zeros left of and above the maps
  std::int64_t after;   // zeros right of and below the maps
};

// Convolves each channel of `maps` (B, C, H, W) with its own kernel `weight` (C, 1, side, side) and adds
// `bias` (C): (B, C, H', W') in channels-last order, of the dtype of `maps`. The value is torch::conv2d's on
// any device. On a CPU, the gradients of float32 and bfloat16 maps are summed in float32 by loops that give
// the same bits for any number of threads; all others are LibTorch's.
torch::Tensor depthwise_convolution(const torch::Tensor& maps, const torch::Tensor& weight,
                                    const torch::Tensor& bias, const DepthwiseShape& shape);

}  // namespace q3d::model
