#include "model/depthwise.h"

#include <ATen/Parallel.h>
#include <gtest/gtest.h>

#include <vector>

namespace q3d::model {
namespace {

constexpr std::int64_t kChannels = 70;  // a whole block of lanes and a part of one
constexpr std::array<bool, 3> kAll{true, true, true};

// Random numbers that are the same in every dtype.
torch::Tensor numbers(const std::vector<std::int64_t>& sizes) {
  return torch::randn(sizes, torch::kFloat64).to(torch::kBFloat16);
}

struct Case {
  torch::Tensor maps, weight, bias, gradient;  // bfloat16
};

class DepthwiseGradients : public ::testing::TestWithParam<ConvolutionShape> {
 protected:
  DepthwiseGradients() {
    at::manual_seed(11);
    const ConvolutionShape& shape = GetParam();
    case_ = {numbers({3, kChannels, 12, 10}).contiguous(at::MemoryFormat::ChannelsLast),
             numbers({kChannels, 1, shape.side, shape.side}),
             numbers({kChannels}),
             {}};
    case_.gradient = numbers(value(case_.maps, case_.weight, case_.bias).sizes().vec());
  }

  static torch::Tensor value(const torch::Tensor& maps, const torch::Tensor& weight,
                             const torch::Tensor& bias) {
    const ConvolutionShape& shape = GetParam();
    const torch::Tensor padded =
        torch::constant_pad_nd(maps, {shape.before, shape.after, shape.before, shape.after});
    return torch::conv2d(padded, weight, bias, shape.stride, at::IntArrayRef({0, 0}), at::IntArrayRef({1, 1}),
                         maps.size(1));
  }

  // LibTorch's in float64.
  ConvolutionGradients exact() const {
    const auto leaf = [](const torch::Tensor& tensor) {
      return tensor.to(torch::kFloat64).detach().requires_grad_();
    };
    const torch::Tensor maps = leaf(case_.maps);
    const torch::Tensor weight = leaf(case_.weight);
    const torch::Tensor bias = leaf(case_.bias);
    value(maps, weight, bias).backward(case_.gradient.to(torch::kFloat64));
    return {maps.grad(), weight.grad(), bias.grad()};
  }

  ConvolutionGradients own(torch::ScalarType dtype, const std::array<bool, 3>& needed = kAll) const {
    return depthwise_gradients(case_.gradient.to(dtype), case_.maps.to(dtype), case_.weight.to(dtype),
                               GetParam(), needed);
  }

  Case case_;
};

double largest_difference(const torch::Tensor& a, const torch::Tensor& b) {
  EXPECT_EQ(a.sizes(), b.sizes());
  return (a.to(torch::kFloat64) - b.to(torch::kFloat64)).abs().max().item<double>();
}

TEST_P(DepthwiseGradients, AreTheExactOnesInFloat32) {
  const ConvolutionGradients got = own(torch::kFloat32);
  EXPECT_EQ(got.maps.scalar_type(), torch::kFloat32);
  EXPECT_LT(largest_difference(got.maps, exact().maps), 1e-5);
  EXPECT_LT(largest_difference(got.weight, exact().weight), 1e-4);
  EXPECT_LT(largest_difference(got.bias, exact().bias), 1e-4);
}

// Only the result is rounded to bfloat16: half a unit of its last place, which is 2^-8 of the number.
TEST_P(DepthwiseGradients, AreRoundedOnceInBfloat16) {
  const ConvolutionGradients got = own(torch::kBFloat16);
  EXPECT_EQ(got.maps.scalar_type(), torch::kBFloat16);
  for (const auto& [rounded, expected] :
       {std::pair{got.maps, exact().maps}, {got.weight, exact().weight}, {got.bias, exact().bias}}) {
    const torch::Tensor allowed = expected.abs() * 0x1p-8 + 1e-4;
    EXPECT_TRUE(((rounded.to(torch::kFloat64) - expected).abs() <= allowed).all().item<bool>());
  }
}

TEST_P(DepthwiseGradients, HaveTheSameBitsForAnyNumberOfThreads) {
  const int before = at::get_num_threads();
  at::set_num_threads(1);
  const ConvolutionGradients one = own(torch::kFloat32);
  at::set_num_threads(3);
  const ConvolutionGradients three = own(torch::kFloat32);
  at::set_num_threads(before);
  EXPECT_TRUE(torch::equal(one.maps, three.maps));
  EXPECT_TRUE(torch::equal(one.weight, three.weight));
  EXPECT_TRUE(torch::equal(one.bias, three.bias));
}

TEST_P(DepthwiseGradients, AreLeftOutWhereNobodyNeedsThem) {
  const ConvolutionGradients of_maps = own(torch::kFloat32, {true, false, false});
  EXPECT_TRUE(torch::equal(of_maps.maps, own(torch::kFloat32).maps));
  EXPECT_FALSE(of_maps.weight.defined() || of_maps.bias.defined());
  const ConvolutionGradients of_bias = own(torch::kFloat32, {false, false, true});
  EXPECT_TRUE(torch::equal(of_bias.bias, own(torch::kFloat32).bias));
  EXPECT_FALSE(of_bias.maps.defined() || of_bias.weight.defined());
}

INSTANTIATE_TEST_SUITE_P(Shapes, DepthwiseGradients,
                         ::testing::Values(ConvolutionShape{3, 1, 1, 1}, ConvolutionShape{5, 1, 2, 2},
                                           ConvolutionShape{3, 2, 0, 1}, ConvolutionShape{5, 2, 1, 2}));

}  // namespace
}  // namespace q3d::model
