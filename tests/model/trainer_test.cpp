#include "model/trainer.h"

#include <gtest/gtest.h>

#include <limits>
#include <optional>

#include "model/checkpoint.h"
#include "model/device.h"
#include "smal/tensors/camera.h"
#include "smal/tensors/rotation.h"
#include "tests/support/parity_smal.h"
#include "tests/support/paths.h"

namespace q3d::model {
namespace {

PrimaConfig small_config() {
  PrimaConfig config = named_config("tiny");
  config.embed_dim = 32, config.heads = 2;
  config.clip_width = 32, config.clip_layers = 1, config.clip_heads = 2, config.clip_out = 16;
  config.dec_dim = 32, config.dec_heads = 2, config.dec_ffn = 32;
  config.drop_path = 0.3;
  return config;
}

// Noise for pictures, and a seeded body of the golden asset to be found in them.
TrainingBatch seeded_batch(const smal::tensors::SmalBody& body, std::uint64_t seed) {
  at::manual_seed(seed);
  constexpr std::int64_t kBatch = 3;
  TrainingBatch batch;
  batch.images = torch::randn({kBatch, 3, 256, 256});
  Targets& targets = batch.targets;
  targets.rotations = smal::tensors::axis_angle_to_matrix_exact(0.3 * torch::randn({kBatch, 35, 3}));
  targets.betas = 0.2 * torch::randn({kBatch, kBetas});
  const torch::Tensor keypoints = body.keypoints(targets.rotations, targets.betas);
  const torch::Tensor translation = torch::tensor({0.0F, 0.0F, 9.0F}).expand({kBatch, 3});
  const torch::Tensor seen = torch::ones({kBatch, 26, 1});
  targets.keypoints_3d = torch::cat({keypoints, seen}, 2);
  targets.keypoints_2d = torch::cat({smal::tensors::project_to_crop(keypoints, translation), seen}, 2);
  targets.has_pose = torch::tensor({1.0F, 0.0F, 1.0F});
  targets.has_betas = torch::tensor({1.0F, 0.0F, 1.0F});
  targets.family = torch::tensor({0, -1, 4}, torch::kInt64);
  return batch;
}

class TrainerTest : public ::testing::Test {
 protected:
  TrainerTest() : body_(asset()) {
    configure_compute(1);
    const auto path = scratch_.path() / "net.safetensors";
    write_initial_checkpoint(path, small_config(), /*seed=*/3);
    checkpoint_.emplace(smal::tensors::SafeTensors::open(path));
    priors_ = load_priors(smal::tensors::SafeTensors::open(testing::parity_dir() / "weights_A.safetensors"),
                          torch::kCPU);
  }

  static const smal::tensors::SmalAsset& asset() {
    static const smal::tensors::SmalAsset golden = testing::load_parity_asset(testing::parity_dir());
    return golden;
  }

  Trainer trainer(const TrainerOptions& options, const PrimaConfig& config = small_config()) const {
    auto net = load_net(*checkpoint_, config, asset(), {});
    return {std::move(net), body_, priors_, options};
  }

  static std::vector<torch::Tensor> weights(const Trainer& trainer) {
    std::vector<torch::Tensor> copies;
    for (const auto& parameter : trainer.net().parameters()) copies.push_back(parameter.detach().clone());
    return copies;
  }

  static bool same(const std::vector<torch::Tensor>& a, const std::vector<torch::Tensor>& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                      [](const auto& x, const auto& y) { return torch::equal(x, y); });
  }

  testing::ScratchDir scratch_;
  smal::tensors::SmalBody body_;
  std::optional<smal::tensors::SafeTensors> checkpoint_;
  Priors priors_;
};

TrainerOptions quick() {
  TrainerOptions options;
  options.schedule.learning_rate = 1e-3;
  options.adversarial = true;
  return options;
}

TEST_F(TrainerTest, LearnsABatchByHeart) {
  Trainer learner = trainer(quick());
  const TrainingBatch batch = seeded_batch(body_, 1);
  const double first = learner.step(batch).loss;
  double last = first;
  for (int i = 0; i < 40; ++i) last = learner.step(batch).loss;
  EXPECT_LT(last, 0.8 * first);
  EXPECT_EQ(learner.steps(), 41);
}

// A head that predicts no change leaves every joint unrotated, where the official gradient is NaN.
TEST_F(TrainerTest, UnrotatedJointsHaveAFiniteGradient) {
  for (const settings::LossVariant variant :
       {settings::LossVariant::sound, settings::LossVariant::official}) {
    TrainerOptions options = quick();
    options.variant = variant;
    Trainer learner = trainer(options);
    {
      const at::NoGradGuard no_grad;
      for (auto& parameter : learner.net().named_parameters()) {
        if (parameter.key().starts_with("smal_head.decpose.2.")) parameter.value().zero_();
      }
    }
    const StepReport report = learner.step(seeded_batch(body_, 2));
    EXPECT_TRUE(std::isfinite(report.loss));
    EXPECT_EQ(report.applied, variant == settings::LossVariant::sound);
  }
}

TEST_F(TrainerTest, ABatchThatIsNotFiniteChangesNothing) {
  Trainer learner = trainer(quick());
  TrainingBatch batch = seeded_batch(body_, 3);
  batch.targets.betas[0][0] = std::numeric_limits<float>::infinity();
  const auto before = weights(learner);
  const StepReport report = learner.step(batch);
  EXPECT_FALSE(report.applied);
  EXPECT_FALSE(std::isfinite(report.loss));
  EXPECT_TRUE(same(before, weights(learner)));
  EXPECT_EQ(learner.steps(), 0);
}

TEST_F(TrainerTest, TheFrozenEncoderStays) {
  Trainer learner = trainer(quick());
  learner.step(seeded_batch(body_, 4));
  for (const auto& parameter : learner.net().named_parameters()) {
    const bool equal = torch::equal(parameter.value(), checkpoint_->tensor(parameter.key()));
    const std::string& name = parameter.key();
    if (name.starts_with("bioclip_embedding.species_model.")) {
      EXPECT_TRUE(equal) << name;
    } else if (name == "backbone.patch_embed.proj.weight" || name == "smal_head.decpose.2.weight") {
      EXPECT_FALSE(equal) << name;
    }
  }
}

TEST_F(TrainerTest, GoesOnBitForBitFromASavedState) {
  const auto path = scratch_.path() / "state.safetensors";
  Trainer straight = trainer(quick());
  // Dropout draws from LibTorch's generator, which a run seeds anew for each step.
  const auto train = [&](Trainer& learner, std::uint64_t first, std::uint64_t end) {
    for (std::uint64_t i = first; i < end; ++i) {
      const TrainingBatch batch = seeded_batch(body_, i);
      at::manual_seed(100 + i);
      learner.step(batch);
    }
  };
  train(straight, 0, 2);
  write_checkpoint(path, small_config(), straight.state());
  train(straight, 2, 4);

  Trainer resumed = trainer(quick());
  resumed.restore(smal::tensors::SafeTensors::open(path));
  EXPECT_EQ(resumed.steps(), 2);
  train(resumed, 2, 4);
  EXPECT_TRUE(same(weights(straight), weights(resumed)));
  // The state is a checkpoint too.
  EXPECT_NO_THROW(load_net(smal::tensors::SafeTensors::open(path), small_config(), asset(), {}));
}

TEST_F(TrainerTest, Bfloat16IsCloseAndLeavesFloat32Weights) {
  PrimaConfig still = small_config();
  still.dropout = still.drop_path = 0.0;
  TrainerOptions mixed = quick();
  mixed.precision = Precision::bfloat16;
  Trainer learner = trainer(mixed, still);
  const TrainingBatch batch = seeded_batch(body_, 6);
  const StepReport half = learner.step(batch);
  const StepReport full = trainer(quick(), still).step(batch);
  EXPECT_NE(half.loss, full.loss);
  EXPECT_NEAR(half.loss, full.loss, 0.02 * full.loss);
  EXPECT_NEAR(half.gradient_norm, full.gradient_norm, 0.1 * full.gradient_norm);
  for (const auto& parameter : learner.net().parameters())
    EXPECT_EQ(parameter.scalar_type(), torch::kFloat32);
  // Casts of the old weights are forgotten: the second step sees the new ones.
  EXPECT_NE(learner.step(batch).loss, half.loss);
}

// The losses couple the samples: priors are means over those without truth, shape features are compared.
TEST_F(TrainerTest, PartsOfABatchHaveTheGradientsOfTheWhole) {
  PrimaConfig still = small_config();
  still.dropout = still.drop_path = 0.0;
  TrainerOptions in_parts = quick();
  in_parts.parts = 2;
  const TrainingBatch batch = seeded_batch(body_, 6);
  Trainer whole = trainer(quick(), still);
  Trainer parts = trainer(in_parts, still);
  const StepReport a = whole.step(batch), b = parts.step(batch);
  ASSERT_TRUE(b.applied);
  ASSERT_EQ(a.terms.size(), b.terms.size());
  for (std::size_t i = 0; i < a.terms.size(); ++i)
    EXPECT_NEAR(a.terms[i].second, b.terms[i].second, 1e-5 + 1e-4 * std::abs(a.terms[i].second))
        << a.terms[i].first;
  for (const auto& parameter : whole.net().named_parameters()) {
    const torch::Tensor& gradient = parameter.value().grad();
    const torch::Tensor& other = parts.net().named_parameters().find(parameter.key())->grad();
    ASSERT_EQ(gradient.defined(), other.defined()) << parameter.key();
    if (!gradient.defined()) continue;
    const double apart = (gradient - other).norm().item<double>();
    EXPECT_LT(apart, 1e-3 * gradient.norm().item<double>() + 1e-4 * a.gradient_norm) << parameter.key();
  }
}

TEST_F(TrainerTest, ClippingBoundsTheGradientNotTheReport) {
  TrainerOptions options = quick();
  options.largest_gradient_norm = 1e-3;
  PrimaConfig still = small_config();
  still.dropout = still.drop_path = 0.0;
  EXPECT_DOUBLE_EQ(trainer(options, still).step(seeded_batch(body_, 7)).gradient_norm,
                   trainer(quick(), still).step(seeded_batch(body_, 7)).gradient_norm);
}

TEST_F(TrainerTest, WithoutKeypointTokensItStillLearns) {
  PrimaConfig config = small_config();
  config.keypoint_tokens = false;
  EXPECT_TRUE(trainer(quick(), config).step(seeded_batch(body_, 8)).applied);
}

TEST_F(TrainerTest, MoreRoundsWithTheSameWeights) {
  PrimaConfig three = small_config();
  three.ief_iterations = 3;
  const Trainer learner = trainer(quick());
  const auto net = with_config(learner.net(), three);
  EXPECT_EQ(net->config().ief_iterations, 3);
  EXPECT_TRUE(torch::equal(*net->named_parameters().find("smal_head.init_pose"),
                           checkpoint_->tensor("smal_head.init_pose")));
  three.dec_ffn = 64;
  EXPECT_THROW(with_config(learner.net(), three), std::invalid_argument);
}

TEST_F(TrainerTest, AnUnknownFamilyIsRefused) {
  TrainingBatch batch = seeded_batch(body_, 9);
  batch.targets.family[0] = 5;
  EXPECT_THROW(trainer(quick()).step(batch), std::invalid_argument);
}

}  // namespace
}  // namespace q3d::model
