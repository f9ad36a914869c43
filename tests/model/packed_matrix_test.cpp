#include "model/packed_matrix.h"

#include <gtest/gtest.h>
#include <torch/csrc/autograd/autograd.h>

#include <stdexcept>

#include "model/device.h"
#include "tests/model/parity_net.h"

namespace q3d::model {
namespace {

class PackedMatrixTest : public ::testing::TestWithParam<torch::ScalarType> {
 protected:
  void SetUp() override {
    if (!packs_matrices(torch::kCPU, GetParam())) GTEST_SKIP() << "this processor's matrices are not packed";
    configure_compute(1);
    at::manual_seed(7);
  }
  static torch::Tensor random(at::IntArrayRef sizes) {
    return (torch::rand(sizes, torch::kFloat64) - 0.5).to(GetParam());
  }
  // A few roundings of sums of 96 products below 1/4.
  static double tolerance() { return GetParam() == torch::kBFloat16 ? 0.03 : 4e-6; }
  static void expect_near(const torch::Tensor& got, const torch::Tensor& expected) {
    testing::expect_close("product", got, expected, tolerance());
  }
};

TEST_P(PackedMatrixTest, MultipliesAsLinear) {
  const torch::Tensor weight = random({40, 96});
  const torch::Tensor bias = random({40});
  const PackedMatrix packed(weight, bias);
  for (const std::int64_t rows : {1, 53, 193}) {
    const torch::Tensor x = random({2, rows, 96});
    const torch::Tensor exact =
        torch::linear(x.to(torch::kFloat64), weight.to(torch::kFloat64), bias.to(torch::kFloat64));
    expect_near(packed.multiply(x), exact);
    expect_near(packed.multiply(x, Activation::gelu), torch::gelu(exact));
    expect_near(packed.multiply(x, Activation::relu), torch::relu(exact));
    expect_near(packed.multiply_without_bias(x), exact - bias.to(torch::kFloat64));
  }
}

TEST_P(PackedMatrixTest, GradientsReachTheInput) {
  const torch::Tensor weight = random({40, 96});
  const PackedMatrix packed(weight, random({40}));
  const torch::Tensor x = random({3, 5, 96}).set_requires_grad(true);
  const torch::Tensor change = random({3, 5, 40});
  const auto gradient = torch::autograd::grad({packed.multiply(x)}, {x}, {change});
  expect_near(gradient.at(0), torch::matmul(change.to(torch::kFloat64), weight.to(torch::kFloat64)));
}

TEST_P(PackedMatrixTest, RefusesOtherShapes) {
  EXPECT_THROW(PackedMatrix(random({4}), {}), std::invalid_argument);
  EXPECT_THROW(PackedMatrix(random({4, 3}), random({3})), std::invalid_argument);
}

INSTANTIATE_TEST_SUITE_P(Dtypes, PackedMatrixTest, ::testing::Values(torch::kFloat32, torch::kBFloat16),
                         [](const auto& which) { return torch::toString(which.param); });

// Numbers are held once: the parameters of packed layers are empty, those that adaptation copies are not.
TEST(PackedNetwork, HoldsItsNumbersOnce) {
  if (!packs_matrices(torch::kCPU, torch::kFloat32))
    GTEST_SKIP() << "this processor's matrices are not packed";
  const Prima packed = testing::parity_prima("A");
  const auto parameters = packed.net().named_parameters();
  EXPECT_EQ(parameters["backbone.blocks.0.mlp.fc1.weight"].numel(), 0);
  EXPECT_EQ(parameters["smal_head.layers.0.cross_attn.in_proj_weight"].numel(), 0);
  EXPECT_GT(parameters["smal_head.decpose.0.weight"].numel(), 0);
  packed.net().train();
  EXPECT_THROW(packed.net().image_tokens(torch::zeros({1, 3, 256, 256})), c10::Error);
}

TEST(PackedNetwork, DoublesStayAsTheyAre) {
  const Prima exact = testing::parity_prima("A", torch::kFloat64);
  for (const auto& parameter : exact.net().named_parameters()) {
    EXPECT_GT(parameter.value().numel(), 0) << parameter.key();
  }
}

}  // namespace
}  // namespace q3d::model
