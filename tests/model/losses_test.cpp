#include "model/losses.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "model/decoder.h"
#include "model/discriminator.h"
#include "pipeline/animal/synthetic_files.h"
#include "pipeline/animal/synthetic_prior.h"
#include "tests/support/paths.h"

namespace q3d::model {
namespace {

TEST(KeypointLoss, IsTheWeightedSumOfAbsoluteErrors) {
  const torch::Tensor predicted = torch::zeros({1, 26, 2});
  torch::Tensor target = torch::zeros({1, 26, 3});
  target[0][3] = torch::tensor({1.0F, -2.0F, 1.0F});
  target[0][4] = torch::tensor({0.5F, 0.25F, 2.0F});  // official files carry a visibility of 2 as the weight
  target[0][5] = torch::tensor({9.0F, 9.0F, 0.0F});
  EXPECT_FLOAT_EQ(keypoint_loss(predicted, target).item<float>(), 3.0F + 1.5F);
}

TEST(KeypointLoss, CentredIgnoresACommonShift) {
  at::manual_seed(1);
  const torch::Tensor predicted = torch::randn({2, 26, 3});
  const torch::Tensor target =
      torch::cat({predicted + torch::tensor({3.0F, -1.0F, 7.0F}), torch::ones({2, 26, 1})}, 2);
  EXPECT_LT(centred_keypoint_loss(predicted, target).item<float>(), 1e-3F);
  EXPECT_GT(keypoint_loss(predicted, target).item<float>(), 500.0F);
}

Priors plain_priors() {
  Priors priors;
  priors.mean_pose = torch::zeros({105});
  priors.precs = torch::eye(105);
  priors.use_index = torch::ones({105});
  priors.use_index.narrow(0, 0, 3).zero_();
  priors.mean_betas = torch::zeros({2, kBetas});
  priors.mean_betas[1].fill_(3.0F);
  priors.betas_prec = torch::stack({torch::eye(kBetas), 2.0 * torch::eye(kBetas)});
  return priors;
}

TEST(PosePrior, LeavesOutTheGlobalOrientationAndSamplesWithTruth) {
  const torch::Tensor pose = torch::full({3, 105}, 2.0F);
  const PartialMean prior = pose_prior(plain_priors(), pose, torch::tensor({0.0F, 1.0F, 0.0F}));
  EXPECT_FLOAT_EQ(prior.sum.item<float>(), 2 * 102 * 4.0F);
  EXPECT_FLOAT_EQ(prior.count.item<float>(), 2 * 105.0F);  // the zeroed three count in the mean
}

TEST(ShapePrior, UsesTheFamilyOrTheNearest) {
  const torch::Tensor betas = torch::full({3, kBetas}, 2.0F);
  const torch::Tensor family = torch::tensor({0, 1, -1}, torch::kInt64);
  const PartialMean prior = shape_prior(plain_priors(), betas, family, torch::zeros({3}));
  // Squared whitened deviations: (2 - 0)^2, (2 * (2 - 3))^2 and the lesser of the two, all 4.
  EXPECT_FLOAT_EQ(prior.value().item<float>(), 4.0F);
  const torch::Tensor near_second = torch::full({1, kBetas}, 3.0F);
  EXPECT_FLOAT_EQ(shape_prior(plain_priors(), near_second, family.narrow(0, 2, 1), torch::zeros({1}))
                      .value()
                      .item<float>(),
                  0.0F);
}

TEST(Priors, OfTheSyntheticQuadrupedSurviveTheDiskAndKnowTheirOwn) {
  const testing::ScratchDir scratch;
  save_priors(scratch.path() / "priors", pipeline::animal::synthetic_priors());
  const Priors priors = load_priors(smal::tensors::SafeTensors::open(scratch.path() / "priors"), torch::kCPU);
  std::mt19937_64 random(4);
  std::vector<torch::Tensor> poses, betas;
  std::vector<std::int64_t> families;
  for (int i = 0; i < 500; ++i) {
    poses.push_back(pipeline::animal::sample_pose(random).flatten());
    families.push_back(i % 5);
    betas.push_back(pipeline::animal::sample_betas(i % 5, random));
  }
  const torch::Tensor none = torch::zeros({500});
  const torch::Tensor family = torch::tensor(families, torch::kInt64);
  // Whitened numbers of the priors' own samples have about unit variance; those of a wrong family do not.
  const double shape = shape_prior(priors, torch::stack(betas), family, none).value().item<double>();
  EXPECT_NEAR(shape, 1.0, 0.3);
  const double wrong =
      shape_prior(priors, torch::stack(betas), (family + 1) % 5, none).value().item<double>();
  EXPECT_GT(wrong, 2.0 * shape);
  const double pose = pose_prior(priors, torch::stack(poses), none).value().item<double>();
  EXPECT_GT(pose, 0.2);
  EXPECT_LT(pose, 2.0);
}

TEST(PartialMean, OfNothingIsZero) {
  const PartialMean prior = pose_prior(plain_priors(), torch::ones({2, 105}), torch::ones({2}));
  EXPECT_EQ(prior.value().item<float>(), 0.0F);
}

TEST(ContrastiveLoss, ByHand) {
  // Two orthogonal features of different families, each twice. An anchor's positive is its copy (similarity
  // 1, logit 10); the two others have logit 0: loss = (0.1 / 0.07) * log((e^10 + 2) / e^10).
  const torch::Tensor features = torch::eye(2);
  const PartialMean loss = contrastive_loss(features, torch::tensor({0, 1}, torch::kInt64));
  const double expected = (0.1 / 0.07) * std::log1p(2.0 * std::exp(-10.0));
  EXPECT_NEAR(loss.value().item<double>(), expected, 1e-6);
  EXPECT_EQ(loss.count.item<float>(), 4.0F);
}

TEST(ContrastiveLoss, SamplesWithoutFamilyTakeNoPart) {
  at::manual_seed(2);
  torch::Tensor features = torch::randn({5, 8});
  features = features / features.norm(2, 1, true);
  const torch::Tensor all = torch::tensor({0, -1, 1, 0, -1}, torch::kInt64);
  const torch::Tensor kept = torch::tensor({0, 2, 3}, torch::kInt64);
  const PartialMean with = contrastive_loss(features, all);
  const PartialMean without = contrastive_loss(features.index_select(0, kept), all.index_select(0, kept));
  EXPECT_FLOAT_EQ(with.value().item<float>(), without.value().item<float>());
  EXPECT_EQ(contrastive_loss(features, torch::full({5}, -1, torch::kInt64)).value().item<float>(), 0.0F);
}

TEST(DiscriminatorLoss, CountsOnlyRealBodies) {
  const torch::Tensor predicted = torch::full({2, 36}, 0.5F);
  const torch::Tensor real = torch::stack({torch::full({36}, 0.0F), torch::full({36}, 7.0F)});
  EXPECT_FLOAT_EQ(adversarial_loss(predicted).item<float>(), 36 * 0.25F);
  EXPECT_FLOAT_EQ(discriminator_loss(predicted, real, torch::tensor({1.0F, 0.0F})).item<float>(),
                  36 * 0.25F + 36 * 1.0F / 2);
}

TEST(Targets, AWrongShapeIsNamed) {
  Targets targets;
  targets.family = torch::zeros({2}, torch::kInt64);
  targets.keypoints_2d = torch::zeros({2, 26, 2});
  try {
    check_targets(targets);
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "targets: keypoints_2d: got (2, 26, 2) Float, expected (2, 26, 3) Float");
  }
}

}  // namespace
}  // namespace q3d::model
