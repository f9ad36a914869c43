// The paper's ablations, as switches of the network's config.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "model/checkpoint.h"
#include "model/net.h"
#include "model/optimiser.h"
#include "tests/support/paths.h"

namespace q3d::model {
namespace {

struct Outcome {
  torch::Tensor initial_betas;
  DecoderOutput output;
};

class Ablation : public ::testing::Test {
 protected:
  // A seeded tiny network in evaluation mode.
  std::shared_ptr<PrimaNet> build(const PrimaConfig& config) {
    const auto path = scratch_.path() / "net.safetensors";
    write_initial_checkpoint(path, config, /*seed=*/9);
    const smal::tensors::SafeTensors file = smal::tensors::SafeTensors::open(path);
    EXPECT_EQ(checkpoint_config(file), config);
    auto net = std::make_shared<PrimaNet>(config);
    const at::NoGradGuard no_grad;
    for (auto& parameter : net->named_parameters()) parameter.value().copy_(file.tensor(parameter.key()));
    net->eval();
    return net;
  }

  static Outcome run(const PrimaNet& net) {
    at::manual_seed(11);
    const ImageFeatures features = net.encode(torch::randn({2, 3, 256, 256}));
    const Decoder& decoder = net.decoder();
    const torch::Tensor betas = decoder.initial_betas(features.bio_token);
    return {betas, decoder.refine(decoder.remember(features.image_tokens), betas, decoder.own_parameters())};
  }

  static bool has_gradient(const PrimaNet& net, const std::string& part) {
    bool found = false;
    for (const auto& parameter : net.named_parameters()) {
      if (parameter.key().find(part) == std::string::npos) continue;
      const torch::Tensor gradient = parameter.value().grad();
      found = found || (gradient.defined() && gradient.abs().max().item<float>() > 0.0F);
    }
    return found;
  }

  testing::ScratchDir scratch_;
};

TEST_F(Ablation, FullNetworkFreezesTheBioEncoder) {
  const auto net = build(named_config("tiny"));
  parameter_groups(*net);
  const Outcome outcome = run(*net);
  (outcome.output.pose_6d.sum() + outcome.output.aux_keypoints_2d.sum()).backward();
  EXPECT_FALSE(has_gradient(*net, "species_model"));
  EXPECT_TRUE(has_gradient(*net, "bio_to_betas_init"));
  EXPECT_TRUE(has_gradient(*net, "keypoint_2d_embeddings"));
}

TEST_F(Ablation, WithoutBioFeaturesAnEncoderLearns) {
  PrimaConfig config = named_config("tiny");
  config.learn_bio_encoder = true;
  const auto net = build(config);
  const auto groups = parameter_groups(*net);
  std::size_t in_groups = 0;
  for (const auto& group : groups) in_groups += group.parameters.size();
  EXPECT_EQ(in_groups, net->parameters().size());
  run(*net).output.pose_6d.sum().backward();
  EXPECT_TRUE(has_gradient(*net, "species_model.visual.conv1"));
}

TEST_F(Ablation, WithoutInitialBetasTheyStartFromZero) {
  PrimaConfig config = named_config("tiny");
  config.betas_from_bio = false;
  const auto net = build(config);
  const Outcome outcome = run(*net);
  EXPECT_TRUE(torch::equal(outcome.initial_betas, torch::zeros({2, kBetas})));
  outcome.output.betas.sum().backward();
  EXPECT_FALSE(has_gradient(*net, "bio_to_betas_init"));
  EXPECT_TRUE(has_gradient(*net, "decshape"));
}

TEST_F(Ablation, WithoutKeypointTokensOnlyTheParameterTokenIsRead) {
  PrimaConfig config = named_config("tiny");
  config.keypoint_tokens = false;
  const auto net = build(config);
  const Outcome outcome = run(*net);
  EXPECT_TRUE(torch::equal(outcome.output.aux_keypoints_2d, torch::zeros({2, kKeypoints, 2})));
  outcome.output.pose_6d.sum().backward();
  EXPECT_FALSE(has_gradient(*net, "keypoint_2d_embeddings"));
  EXPECT_TRUE(has_gradient(*net, "layers.0.cross_attn"));
  EXPECT_GT(
      (outcome.output.pose_6d - run(*build(named_config("tiny"))).output.pose_6d).abs().max().item<float>(),
      1e-4F);
}

}  // namespace
}  // namespace q3d::model
