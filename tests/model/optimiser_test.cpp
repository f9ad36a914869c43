#include "model/optimiser.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/optim/adamw.h>

#include "model/net.h"
#include "tests/support/paths.h"

namespace q3d::model {
namespace {

// Two groups of parameters with seeded numbers, and seeded gradients for each step.
struct Problem {
  explicit Problem(std::uint64_t seed) {
    at::manual_seed(seed);
    for (const std::int64_t size : {7, 33}) {
      parameters.push_back(torch::randn({size, 3}).requires_grad_());
    }
  }
  std::vector<ParameterGroup> groups() const {
    return {{{{"first", parameters[0]}}, 0.1}, {{{"second", parameters[1]}}, 1.0}};
  }
  void set_gradients(int step) {
    at::manual_seed(1000 + static_cast<std::uint64_t>(step));
    for (torch::Tensor& parameter : parameters) parameter.mutable_grad() = torch::randn_like(parameter);
  }
  std::vector<torch::Tensor> parameters;
};

TEST(AdamW, EqualsLibTorchs) {
  Problem ours(3), theirs(3);
  AdamW optimiser(ours.groups(), {.weight_decay = 0.05});
  std::vector<torch::optim::OptimizerParamGroup> groups;
  for (const double scale : {0.1, 1.0}) {
    auto options = std::make_unique<torch::optim::AdamWOptions>(0.01 * scale);
    options->weight_decay(0.05);
    groups.emplace_back(std::vector<torch::Tensor>{theirs.parameters[scale == 1.0 ? 1 : 0]},
                        std::move(options));
  }
  torch::optim::AdamW reference(groups);
  for (int step = 0; step < 10; ++step) {
    ours.set_gradients(step);
    theirs.set_gradients(step);
    optimiser.step(0.01);
    reference.step();
  }
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_TRUE(torch::allclose(ours.parameters[i], theirs.parameters[i], 1e-6, 1e-7));
  }
}

TEST(AdamW, StateSurvivesTheDiskBitForBit) {
  const testing::ScratchDir scratch;
  const auto path = scratch.path() / "state.safetensors";
  Problem straight(4), resumed(4);
  AdamW whole(straight.groups(), {});
  AdamW half(resumed.groups(), {});
  for (int step = 0; step < 3; ++step) {
    straight.set_gradients(step);
    resumed.set_gradients(step);
    whole.step(0.01);
    half.step(0.01);
  }
  smal::tensors::NamedTensors state;
  half.append_state(state, "optimiser.");
  smal::tensors::write_safetensors(path, state);
  AdamW restored(resumed.groups(), {});
  restored.restore_state(smal::tensors::SafeTensors::open(path), "optimiser.");
  for (int step = 3; step < 6; ++step) {
    straight.set_gradients(step);
    resumed.set_gradients(step);
    whole.step(0.02);
    restored.step(0.02);
  }
  for (std::size_t i = 0; i < 2; ++i)
    EXPECT_TRUE(torch::equal(straight.parameters[i], resumed.parameters[i]));
}

TEST(AdamW, AMissingTensorIsNamed) {
  const testing::ScratchDir scratch;
  Problem problem(5);
  AdamW optimiser(problem.groups(), {});
  smal::tensors::write_safetensors(scratch.path() / "s", {{"first.exp_avg", torch::zeros({7, 3})}});
  try {
    optimiser.restore_state(smal::tensors::SafeTensors::open(scratch.path() / "s"), "");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("first.exp_avg_sq"));
  }
}

TEST(AdamW, LeavesAParameterWithoutGradientAlone) {
  Problem problem(6);
  const torch::Tensor before = problem.parameters[1].detach().clone();
  AdamW optimiser(problem.groups(), {.weight_decay = 0.5});
  problem.set_gradients(0);
  problem.parameters[1].mutable_grad().reset();
  optimiser.step(0.1);
  EXPECT_TRUE(torch::equal(problem.parameters[1], before));
}

TEST(AdamW, ClipsToTheWholeNorm) {
  Problem problem(7);
  AdamW optimiser(problem.groups(), {});
  problem.set_gradients(0);
  const torch::Tensor together =
      torch::cat({problem.parameters[0].grad().flatten(), problem.parameters[1].grad().flatten()});
  const double norm = together.norm().item<double>();
  EXPECT_NEAR(optimiser.gradient_norm().item<double>(), norm, 1e-5 * norm);
  optimiser.clip(optimiser.gradient_norm(), 2.0 * norm);
  EXPECT_NEAR(optimiser.gradient_norm().item<double>(), norm, 1e-5 * norm);
  optimiser.clip(optimiser.gradient_norm(), 0.5);
  EXPECT_NEAR(optimiser.gradient_norm().item<double>(), 0.5, 1e-5);
}

TEST(RateSchedule, WarmsUpAndDecaysLinearly) {
  const RateSchedule schedule{.learning_rate = 1.0, .warm_up_steps = 4, .decay_end_step = 12};
  EXPECT_DOUBLE_EQ(rate_at(schedule, 0), 0.25);
  EXPECT_DOUBLE_EQ(rate_at(schedule, 3), 1.0);
  EXPECT_DOUBLE_EQ(rate_at(schedule, 4), 1.0);
  EXPECT_DOUBLE_EQ(rate_at(schedule, 8), 0.5);
  EXPECT_DOUBLE_EQ(rate_at(schedule, 12), 0.0);
  EXPECT_DOUBLE_EQ(rate_at(schedule, 20), 0.0);
  EXPECT_DOUBLE_EQ(rate_at({.learning_rate = 2.0}, 1'000'000), 2.0);
}

TEST(ParameterGroups, FollowTheOfficialCode) {
  PrimaNet net(named_config("tiny"));
  const auto groups = parameter_groups(net);
  ASSERT_EQ(groups.size(), 2U);
  EXPECT_DOUBLE_EQ(groups[0].rate_scale, 0.1);
  for (const auto& [name, tensor] : groups[0].parameters) EXPECT_TRUE(name.starts_with("backbone.")) << name;
  for (const auto& [name, tensor] : groups[1].parameters) {
    EXPECT_TRUE(name.starts_with("smal_head.") || name.starts_with("bioclip_embedding.projection.")) << name;
    EXPECT_TRUE(tensor.requires_grad());
  }
  for (const auto& parameter : net.named_parameters()) {
    if (parameter.key().find("species_model") != std::string::npos) {
      EXPECT_FALSE(parameter.value().requires_grad()) << parameter.key();
    }
  }
}

bool in_efficientnet(const std::string& name) {
  return name.find(".efficientnet.") != std::string::npos;
}

PrimaConfig stemmed() {
  PrimaConfig config = named_config("tiny");
  config.efficientnet_stem = config.clip_efficientnet_stem = true;
  return config;
}

TEST(ParameterGroups, AnEfficientNetLearnsAtItsOwnRateBehindTheFrozenBlocks) {
  PrimaNet net(stemmed());
  const auto groups = parameter_groups(net, 0.5, {.rate_scale = 0.2, .frozen_blocks = 3});
  ASSERT_EQ(groups.size(), 3U);  // the bio encoder does not learn, its EfficientNet neither
  EXPECT_DOUBLE_EQ(groups[0].rate_scale, 0.5);
  EXPECT_DOUBLE_EQ(groups[1].rate_scale, 1.0);
  EXPECT_DOUBLE_EQ(groups[2].rate_scale, 0.1);
  std::size_t in_groups = 0;
  for (const std::size_t group : {0U, 1U, 2U}) {
    for (const auto& [name, tensor] : groups[group].parameters) {
      EXPECT_EQ(in_efficientnet(name), group == 2) << name;
      EXPECT_TRUE(tensor.requires_grad()) << name;
      ++in_groups;
    }
  }
  EXPECT_EQ(groups[2].parameters.front().first,
            "backbone.patch_embed.efficientnet._blocks.3._expand_conv.weight");
  std::size_t learning = 0;
  for (const auto& parameter : net.named_parameters())
    learning += parameter.value().requires_grad() ? 1U : 0U;
  EXPECT_EQ(in_groups, learning);
}

TEST(ParameterGroups, ABioEncoderThatLearnsHasAStemOfItsOwnRate) {
  PrimaConfig config = stemmed();
  config.learn_bio_encoder = true;
  PrimaNet net(config);
  const auto groups = parameter_groups(net, 0.5, {.rate_scale = 0.2, .frozen_blocks = 3});
  ASSERT_EQ(groups.size(), 4U);
  EXPECT_DOUBLE_EQ(groups[3].rate_scale, 0.2);
  for (const auto& [name, tensor] : groups[3].parameters) {
    EXPECT_TRUE(name.starts_with("bioclip_embedding.species_model.visual.efficientnet._blocks.")) << name;
  }
}

TEST(EncoderGroups, HoldTheEncodersAndTheirStems) {
  PrimaNet net(stemmed());
  const auto groups = encoder_groups(net, {.rate_scale = 0.2, .frozen_blocks = 0});
  ASSERT_EQ(groups.size(), 2U);
  EXPECT_DOUBLE_EQ(groups[0].rate_scale, 1.0);
  EXPECT_DOUBLE_EQ(groups[1].rate_scale, 0.2);
  for (const std::size_t group : {0U, 1U}) {
    for (const auto& [name, tensor] : groups[group].parameters) {
      EXPECT_EQ(in_efficientnet(name), group == 1) << name;
      EXPECT_TRUE(name.starts_with("backbone.") || name.starts_with("bioclip_embedding.species_model."))
          << name;
    }
  }
  EXPECT_EQ(groups[1].parameters.size(), 2U * 99U);
  for (const auto& parameter : net.named_parameters()) {
    const bool encoder = parameter.key().starts_with("backbone.") ||
                         parameter.key().starts_with("bioclip_embedding.species_model.");
    EXPECT_EQ(parameter.value().requires_grad(), encoder) << parameter.key();
  }
  PrimaNet plain(named_config("tiny"));
  EXPECT_EQ(encoder_groups(plain).size(), 1U);
}

}  // namespace
}  // namespace q3d::model
