// Gradients of a depthwise convolution, by loops of our own.
//
// LibTorch computes the value fast. On a CPU, its gradients of maps in channels-last order take ten to sixty
// times as long as the value, and were the largest part of a training step of an EfficientNet stem.
#pragma once

#include <torch/types.h>

#include <array>

namespace q3d::model {

struct ConvolutionShape {
  std::int64_t side;    // of the square kernel, in pixels
  std::int64_t stride;  // 1 or 2
  std::int64_t before;  // zeros left of and above the maps
  std::int64_t after;   // zeros right of and below the maps
};

struct ConvolutionGradients {
  torch::Tensor maps, weight, bias;  // undefined where they are not needed
};

// `gradient` (B, C, H', W') is that of the result; maps (B, C, H, W), weight (C, 1, side, side). All are
// float32 or all bfloat16, on a CPU, and so are the results; maps' gradient is in channels-last order.
// `needed` says which of maps, weight and bias get one. The numbers are summed in float32, with the same bits
// for any number of threads.
ConvolutionGradients depthwise_gradients(const torch::Tensor& gradient, const torch::Tensor& maps,
                                         const torch::Tensor& weight, const ConvolutionShape& shape,
                                         const std::array<bool, 3>& needed);

}  // namespace q3d::model
