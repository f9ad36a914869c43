#include "model/conv_stem.h"

#include <gtest/gtest.h>

namespace q3d::model {
namespace {

// A stem whose convolutions pass their first input channel on: the centre weight is 1, all others 0.
TEST(ConvStem, FollowsTheHandComputedMaps) {
  const at::NoGradGuard no_grad;
  ConvStem stem(64, 1, {torch::kCPU, torch::kFloat64});
  for (auto& parameter : stem.named_parameters()) {
    torch::Tensor& value = parameter.value();
    value.zero_();
    if (value.dim() == 4)
      value.select(1, 0).select(1, value.size(2) / 2).select(1, value.size(3) / 2).fill_(1);
    if (parameter.key().ends_with("norm.weight")) value.fill_(1);
  }
  stem.named_parameters()["proj.weight"].copy_(torch::eye(64, torch::kFloat64));
  at::manual_seed(5);
  const torch::Tensor images = torch::randn({2, 3, 64, 32}, torch::kFloat64);
  // All channels are equal, so group norm standardises each picture's map by itself.
  const auto unit = [](const torch::Tensor& map, std::int64_t stride) {
    const torch::Tensor kept = map.slice(1, 0, map.size(1), stride).slice(2, 0, map.size(2), stride);
    const torch::Tensor centred = kept - kept.mean({1, 2}, true);
    return torch::relu(centred / (centred.square().mean({1, 2}, true) + 1e-5).sqrt());
  };
  torch::Tensor expected = images.select(1, 0);
  for (const std::int64_t stride : {4, 2, 1, 2, 1}) expected = unit(expected, stride);
  const torch::Tensor tokens = stem.forward(images);
  ASSERT_EQ(tokens.sizes(), (at::IntArrayRef{2, 8, 64}));
  EXPECT_GT(expected.abs().max().item<double>(), 0.1);
  for (const std::int64_t channel : {0, 17, 63}) {
    EXPECT_TRUE(torch::allclose(tokens.select(2, channel), expected.flatten(1), 1e-9, 1e-12)) << channel;
  }
}

TEST(Tokeniser, RegistersTheOfficialNameOrAStem) {
  const Tokeniser::Patches patches{"proj", 16, 2, true};
  torch::nn::Module official("official");
  const Tokeniser plain(official, patches, 64, {}, {});
  EXPECT_EQ(official.named_parameters().keys(), (std::vector<std::string>{"proj.weight", "proj.bias"}));
  torch::nn::Module ours("ours");
  const Tokeniser stemmed(ours, patches, 64, {.depth = 2}, {});
  for (const std::string& name : ours.named_parameters().keys())
    EXPECT_TRUE(name.starts_with("stem.")) << name;
  EXPECT_EQ(stemmed.forward(torch::zeros({1, 3, 256, 192})).sizes(), (at::IntArrayRef{1, 192, 64}));
}

// The matrix in the projection's place maps the channels of each place on the map to its token, in row-major
// order.
TEST(Tokeniser, MapsAnEfficientNetsChannels) {
  const at::NoGradGuard no_grad;
  torch::nn::Module owner("owner");
  const Tokeniser tokeniser(owner, {"conv1", 16, 0, false}, 64, {.efficientnet = true}, {});
  at::manual_seed(2);
  for (auto& parameter : owner.named_parameters()) {
    EXPECT_TRUE(parameter.key().starts_with("efficientnet.") || parameter.key() == "conv1.weight" ||
                parameter.key() == "conv1.bias")
        << parameter.key();
    torch::Tensor& value = parameter.value();
    value.copy_(0.2 * torch::randn(value.sizes()));
    if (parameter.key().find("_bn") != std::string::npos && value.dim() == 1) value.fill_(1.0);
  }
  const auto parameters = owner.named_parameters();
  const auto network = std::dynamic_pointer_cast<EfficientNetLite>(owner.children().front());
  ASSERT_NE(network, nullptr);
  const torch::Tensor images = torch::randn({2, 3, 64, 32});
  const torch::Tensor maps = network->forward(images), tokens = tokeniser.forward(images);
  ASSERT_EQ(tokens.sizes(), (at::IntArrayRef{2, 8, 64}));
  for (const auto& [row, column] : {std::pair{0, 1}, std::pair{3, 0}}) {
    const torch::Tensor expected =
        parameters["conv1.weight"].mv(maps[1].select(2, column).select(1, row)) + parameters["conv1.bias"];
    EXPECT_TRUE(torch::allclose(tokens[1][2 * row + column], expected, 1e-4, 1e-5)) << row;
  }
}

}  // namespace
}  // namespace q3d::model
