#include "model/efficientnet_lite.h"

#include <gtest/gtest.h>

#include "model/pretrained_stem.h"
#include "smal/tensors/safetensors.h"
#include "tests/support/paths.h"

namespace q3d::model {
namespace {

// The stem that the project ships, which tools/import_stem.py made.
std::filesystem::path shipped_stem() {
  return testing::source_dir() / "models" / "efficientnet_lite0.safetensors";
}

std::shared_ptr<EfficientNetLite> shipped_network(torch::ScalarType dtype) {
  const at::NoGradGuard no_grad;
  const PretrainedStem stem(shipped_stem());
  auto network = std::make_shared<EfficientNetLite>(Placement{torch::kCPU, dtype});
  for (auto& parameter : network->named_parameters()) {
    parameter.value().copy_(
        stem.values({"encoder.efficientnet." + parameter.key(), parameter.value().sizes().vec()}));
  }
  return network;
}

// Reads what the package efficientnet-lite-pytorch computed (tests/data/efficientnet/make.py).
class Golden : public ::testing::Test {
 protected:
  // The pictures as PrimaNet takes them.
  torch::Tensor images(torch::ScalarType dtype) const {
    const auto per_channel = [](std::vector<double> numbers) {
      return torch::tensor(numbers, torch::kFloat64).view({1, 3, 1, 1});
    };
    const torch::Tensor unit = file_.tensor("pictures").to(torch::kFloat64) / 255.0;
    return ((unit - per_channel({0.485, 0.456, 0.406})) / per_channel({0.229, 0.224, 0.225})).to(dtype);
  }
  torch::Tensor features() const { return file_.tensor("features"); }

  smal::tensors::SafeTensors file_ =
      smal::tensors::SafeTensors::open(testing::data_dir() / "efficientnet" / "features.safetensors");
};

TEST_F(Golden, FeaturesAreThePackages) {
  const at::NoGradGuard no_grad;
  const torch::Tensor got = shipped_network(torch::kFloat64)->forward(images(torch::kFloat64));
  ASSERT_EQ(got.sizes(), features().sizes());
  ASSERT_EQ(got.sizes(), (at::IntArrayRef{2, EfficientNetLite::kChannels, 8, 6}));
  EXPECT_GT(features().std().item<double>(), 1.0);
  EXPECT_TRUE(torch::allclose(got, features(), /*rtol=*/1e-5, /*atol=*/1e-5))
      << (got - features()).abs().max().item<double>();
}

TEST_F(Golden, FeaturesInFloat32DifferByItsRounding) {
  const at::NoGradGuard no_grad;
  const torch::Tensor got = shipped_network(torch::kFloat32)->forward(images(torch::kFloat32));
  ASSERT_EQ(got.scalar_type(), torch::kFloat32);
  const torch::Tensor error = (got.to(torch::kFloat64) - features()).abs().max();
  EXPECT_LT(error.item<double>(), 1e-5 * features().abs().max().item<double>());
}

// The same holds while it trains: batch norm uses the statistics of ImageNet, and none of the batch.
TEST_F(Golden, APictureDoesNotSeeItsNeighbours) {
  const auto network = shipped_network(torch::kFloat64);
  ASSERT_TRUE(network->is_training());
  const torch::Tensor both = network->forward(images(torch::kFloat64));
  const torch::Tensor alone = network->forward(images(torch::kFloat64).narrow(0, 1, 1));
  EXPECT_TRUE(torch::allclose(both.narrow(0, 1, 1), alone, 1e-12, 1e-12));
}

// The derivative along a random direction in the space of all weights, against differences.
TEST_F(Golden, GradientsAreTheSlopes) {
  const auto network = shipped_network(torch::kFloat64);
  const torch::Tensor pictures = images(torch::kFloat64);
  const auto loss = [&] { return network->forward(pictures).square().mean(); };
  loss().backward();
  at::manual_seed(3);
  const at::NoGradGuard no_grad;
  std::vector<torch::Tensor> direction;
  double slope = 0.0;
  for (const torch::Tensor& parameter : network->parameters()) {
    direction.push_back(torch::randn_like(parameter) * parameter.abs().mean());
    slope += (parameter.grad() * direction.back()).sum().item<double>();
  }
  const auto move = [&](double step) {
    const auto parameters = network->parameters();
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      torch::Tensor parameter = parameters[i];
      parameter.add_(direction[i], step);
    }
  };
  constexpr double kStep = 1e-7;
  move(kStep);
  const double ahead = loss().item<double>();
  move(-2.0 * kStep);
  const double behind = loss().item<double>();
  EXPECT_GT(std::abs(slope), 1e-3);
  EXPECT_NEAR((ahead - behind) / (2.0 * kStep), slope, 1e-3 * std::abs(slope));
}

TEST(EfficientNetNames, AreThoseBehindTheModule) {
  EXPECT_EQ(name_in_efficientnet("backbone.patch_embed.efficientnet._blocks.3._bn1.bias"),
            "_blocks.3._bn1.bias");
  EXPECT_EQ(name_in_efficientnet("backbone.patch_embed.proj.weight"), "");
}

TEST(EfficientNetNames, FirstBlocksAreCountedFromTheFirstConvolution) {
  const std::string prefix = "backbone.patch_embed.efficientnet.";
  for (const char* name :
       {"_conv_stem.weight", "_bn0.bias", "_blocks.0._bn1.weight", "_blocks.1._bn2.bias"}) {
    EXPECT_TRUE(is_in_first_blocks(prefix + name, 2)) << name;
    EXPECT_FALSE(is_in_first_blocks(prefix + name, 0)) << name;
  }
  for (const char* name : {"_blocks.2._bn0.bias", "_blocks.10._bn0.bias"}) {
    EXPECT_FALSE(is_in_first_blocks(prefix + name, 2)) << name;
    EXPECT_TRUE(is_in_first_blocks(prefix + name, EfficientNetLite::kBlocks)) << name;
  }
  EXPECT_FALSE(is_in_first_blocks("backbone.patch_embed.proj.weight", EfficientNetLite::kBlocks));
}

}  // namespace
}  // namespace q3d::model
