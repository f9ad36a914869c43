#include "model/depthwise.h"

#include <ATen/Parallel.h>
#include <gtest/gtest.h>

#include <vector>

namespace q3d::model {
namespace {

struct Gradients {
  torch::Tensor value, maps, weight, bias;
};

// The value and the gradients of sum(value * direction).
template <typename Convolution>
Gradients differentiate(torch::ScalarType dtype, const DepthwiseShape& shape,
                        const Convolution& convolution) {
  constexpr std::int64_t kChannels = 70;  // a whole block of lanes and a part of one
  at::manual_seed(11);
  const auto made = [&](std::vector<std::int64_t> sizes) {
    return torch::randn(sizes, torch::kFloat64).to(torch::kBFloat16).to(dtype);  // the same in every dtype
  };
  const torch::Tensor maps =
      made({3, kChannels, 12, 10}).contiguous(at::MemoryFormat::ChannelsLast).requires_grad_();
  const torch::Tensor weight = made({kChannels, 1, shape.side, shape.side}).requires_grad_();
  const torch::Tensor bias = made({kChannels}).requires_grad_();
  const torch::Tensor value = convolution(maps, weight, bias, shape);
  (value * made(value.sizes().vec())).sum().backward();
  return {value.detach(), maps.grad(), weight.grad(), bias.grad()};
}

torch::Tensor of_libtorch(const torch::Tensor& maps, const torch::Tensor& weight, const torch::Tensor& bias,
                          const DepthwiseShape& shape) {
  const torch::Tensor padded =
      torch::constant_pad_nd(maps, {shape.before, shape.after, shape.before, shape.after});
  return torch::conv2d(padded, weight, bias, shape.stride, at::IntArrayRef({0, 0}), at::IntArrayRef({1, 1}),
                       maps.size(1));
}

double largest_difference(const torch::Tensor& a, const torch::Tensor& b) {
  EXPECT_EQ(a.sizes(), b.sizes());
  return (a.to(torch::kFloat64) - b.to(torch::kFloat64)).abs().max().item<double>();
}

class DepthwiseGradients : public ::testing::TestWithParam<DepthwiseShape> {};

// The exact gradients are LibTorch's in float64.
TEST_P(DepthwiseGradients, AreTheExactOnesInFloat32) {
  const Gradients exact = differentiate(torch::kFloat64, GetParam(), of_libtorch);
  const Gradients own = differentiate(torch::kFloat32, GetParam(), depthwise_convolution);
  EXPECT_LT(largest_difference(own.value, exact.value), 1e-5);
  EXPECT_LT(largest_difference(own.maps, exact.maps), 1e-5);
  EXPECT_LT(largest_difference(own.weight, exact.weight), 1e-4);
  EXPECT_LT(largest_difference(own.bias, exact.bias), 1e-4);
}

// Only the result is rounded to bfloat16: half a unit of its last place, which is 2^-8 of the number.
TEST_P(DepthwiseGradients, AreRoundedOnceInBfloat16) {
  const auto once_rounded = [](const torch::Tensor& maps, const torch::Tensor& weight,
                               const torch::Tensor& bias, const DepthwiseShape& shape) {
    return of_libtorch(maps, weight, bias, shape).to(torch::kBFloat16).to(torch::kFloat64);
  };
  const Gradients exact = differentiate(torch::kFloat64, GetParam(), once_rounded);
  const Gradients own = differentiate(torch::kBFloat16, GetParam(), depthwise_convolution);
  EXPECT_EQ(own.maps.scalar_type(), torch::kBFloat16);
  for (const auto& [got, expected] :
       {std::pair{own.maps, exact.maps}, {own.weight, exact.weight}, {own.bias, exact.bias}}) {
    const torch::Tensor allowed = expected.abs() * 0x1p-8 + 1e-4;
    EXPECT_TRUE(((got.to(torch::kFloat64) - expected).abs() <= allowed).all().item<bool>());
  }
}

TEST_P(DepthwiseGradients, HaveTheSameBitsForAnyNumberOfThreads) {
  const int before = at::get_num_threads();
  at::set_num_threads(1);
  const Gradients one = differentiate(torch::kFloat32, GetParam(), depthwise_convolution);
  at::set_num_threads(3);
  const Gradients three = differentiate(torch::kFloat32, GetParam(), depthwise_convolution);
  at::set_num_threads(before);
  EXPECT_TRUE(torch::equal(one.maps, three.maps));
  EXPECT_TRUE(torch::equal(one.weight, three.weight));
  EXPECT_TRUE(torch::equal(one.bias, three.bias));
}

INSTANTIATE_TEST_SUITE_P(Shapes, DepthwiseGradients,
                         ::testing::Values(DepthwiseShape{3, 1, 1, 1}, DepthwiseShape{5, 1, 2, 2},
                                           DepthwiseShape{3, 2, 0, 1}, DepthwiseShape{5, 2, 1, 2}));

// Double precision has no loops of its own, so second derivatives and golden numbers stay LibTorch's.
TEST(Depthwise, LeavesFloat64ToLibtorch) {
  const DepthwiseShape shape{3, 2, 0, 1};
  const Gradients exact = differentiate(torch::kFloat64, shape, of_libtorch);
  const Gradients own = differentiate(torch::kFloat64, shape, depthwise_convolution);
  EXPECT_TRUE(torch::equal(own.maps, exact.maps));
  EXPECT_TRUE(torch::equal(own.weight, exact.weight));
}

}  // namespace
}  // namespace q3d::model
