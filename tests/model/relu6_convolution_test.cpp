#include "model/relu6_convolution.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace q3d::model {
namespace {

struct Case {
  std::string name;
  ConvolutionShape shape;
  std::int64_t in, out;
  bool depthwise;
  Frame frame;
};

void PrintTo(const Case& tried, std::ostream* out) {
  *out << tried.name;
}

struct Result {
  torch::Tensor value, maps, weight, bias;
};

struct Inputs {
  torch::Tensor maps, weight, bias;
};

class Relu6Convolution : public ::testing::TestWithParam<Case> {
 protected:
  static torch::Tensor made(const std::vector<std::int64_t>& sizes, double scale, torch::ScalarType dtype) {
    return (torch::randn(sizes, torch::kFloat64) * scale).to(torch::kBFloat16).to(dtype);
  }

  // The same numbers in every dtype.
  static Inputs inputs(torch::ScalarType dtype) {
    const auto& [name, shape, in, out, depthwise, frame] = GetParam();
    at::manual_seed(7);
    return {made({3, in, 12, 10}, 1.0, dtype).contiguous(at::MemoryFormat::ChannelsLast),
            made({out, depthwise ? 1 : in, shape.side, shape.side}, 1.0, dtype), made({out}, 2.0, dtype)};
  }

  // relu6_convolution, or LibTorch's operators, and the gradients of sum(value * direction).
  static Result differentiate(torch::ScalarType dtype, bool own) {
    const auto [maps, weight, bias] = inputs(dtype);
    for (const torch::Tensor& leaf : {maps, weight, bias}) leaf.requires_grad_();
    const torch::Tensor value =
        own ? relu6_convolution(maps, weight, bias, GetParam().shape, GetParam().frame)
            : of_libtorch(maps, weight, bias);
    (value * made(value.sizes().vec(), 1.0, dtype)).sum().backward();
    return {value.detach(), maps.grad(), weight.grad(), bias.grad()};
  }

 private:
  static torch::Tensor of_libtorch(const torch::Tensor& maps, const torch::Tensor& weight,
                                   const torch::Tensor& bias) {
    const auto& [name, shape, in, out, depthwise, frame] = GetParam();
    const torch::Tensor padded =
        torch::constant_pad_nd(maps, {shape.before, shape.after, shape.before, shape.after});
    const torch::Tensor value = torch::conv2d(padded, weight, bias, shape.stride, at::IntArrayRef({0, 0}),
                                              at::IntArrayRef({1, 1}), depthwise ? in : 1);
    return torch::constant_pad_nd(torch::hardtanh(value, 0.0, 6.0),
                                  {frame.before, frame.after, frame.before, frame.after});
  }
};

double largest_difference(const torch::Tensor& a, const torch::Tensor& b) {
  EXPECT_EQ(a.sizes(), b.sizes());
  return (a.to(torch::kFloat64) - b.to(torch::kFloat64)).abs().max().item<double>();
}

TEST_P(Relu6Convolution, HasTheExactValueAndGradients) {
  const Result exact = differentiate(torch::kFloat64, false);
  // Both of ReLU6's limits are met, and numbers between them.
  EXPECT_EQ(exact.value.min().item<double>(), 0.0);
  EXPECT_EQ(exact.value.max().item<double>(), 6.0);
  EXPECT_GT(((exact.value > 0.0) & (exact.value < 6.0)).to(torch::kFloat64).mean().item<double>(), 0.2);
  const Result own = differentiate(torch::kFloat32, true);
  EXPECT_LT(largest_difference(own.value, exact.value), 1e-5);
  EXPECT_LT(largest_difference(own.maps, exact.maps), 1e-4);
  EXPECT_LT(largest_difference(own.weight, exact.weight), 1e-4);
  EXPECT_LT(largest_difference(own.bias, exact.bias), 1e-4);
}

// One pass gives the bits of two.
TEST_P(Relu6Convolution, HasTheBitsOfTwoOperators) {
  for (const torch::ScalarType dtype : {torch::kFloat32, torch::kBFloat16, torch::kFloat64}) {
    const Result own = differentiate(dtype, true);
    const Result two = differentiate(dtype, false);
    EXPECT_EQ(own.value.scalar_type(), dtype);
    EXPECT_TRUE(torch::equal(own.value, two.value)) << torch::toString(dtype);
  }
}

TEST_P(Relu6Convolution, IsTheSameWithoutGradients) {
  const Result with = differentiate(torch::kFloat32, true);
  const at::NoGradGuard no_grad;
  const auto [maps, weight, bias] = inputs(torch::kFloat32);
  EXPECT_TRUE(
      torch::equal(relu6_convolution(maps, weight, bias, GetParam().shape, GetParam().frame), with.value));
}

INSTANTIATE_TEST_SUITE_P(Shapes, Relu6Convolution,
                         ::testing::Values(Case{"dense", {3, 2, 0, 1}, 5, 20, false, {}},
                                           Case{"pointwise", {1, 1, 0, 0}, 6, 70, false, {}},
                                           Case{"framed", {1, 1, 0, 0}, 6, 70, false, {0, 1}},
                                           Case{"framed_on_both_sides", {1, 1, 0, 0}, 6, 70, false, {1, 2}},
                                           Case{"depthwise", {3, 1, 1, 1}, 70, 70, true, {}},
                                           Case{"depthwise_uneven", {5, 2, 1, 2}, 70, 70, true, {}}),
                         [](const auto& tried) { return tried.param.name; });

TEST(Relu6ConvolutionFrame, IsForConvolutionsOfOnePixelAlone) {
  const torch::Tensor maps = torch::zeros({1, 2, 4, 4});
  EXPECT_THROW(relu6_convolution(maps, torch::zeros({2, 2, 3, 3}), torch::zeros({2}), {3, 1, 1, 1}, {0, 1}),
               std::invalid_argument);
}

}  // namespace
}  // namespace q3d::model
