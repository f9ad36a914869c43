#include "pipeline/animal/synthetic_prior.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "pipeline/animal/synthetic_motion.h"
#include "pipeline/animal/synthetic_quadruped.h"
#include "smal/tensors/asset.h"

namespace q3d::pipeline::animal {
namespace {

double worst(const torch::Tensor& a, const torch::Tensor& b) {
  return (a - b).abs().max().item<double>();
}

// (covariance + ridge I) times the precision must be the identity.
void expect_precision(const torch::Tensor& covariance, const torch::Tensor& precs) {
  const torch::Tensor identity = torch::eye(covariance.size(0), torch::kFloat64);
  const torch::Tensor lower = precs.to(torch::kFloat64);
  EXPECT_EQ(worst(lower.triu(1), torch::zeros_like(lower)), 0.0);
  const torch::Tensor product =
      torch::matmul(covariance.to(torch::kFloat64) + 1e-5 * identity, torch::matmul(lower, lower.t()));
  EXPECT_LT(worst(product, identity), 5e-3);  // float32 storage of numbers up to some hundreds
}

TEST(PosePrior, HasTheOfficialLayout) {
  const PosePrior prior = synthetic_pose_prior();
  EXPECT_EQ(prior.mean.sizes(), torch::IntArrayRef({105}));
  EXPECT_EQ(prior.covariance.sizes(), torch::IntArrayRef({105, 105}));
  EXPECT_EQ(prior.mean.slice(0, 0, 3).abs().sum().item<double>(), 0.0);
  EXPECT_TRUE(torch::equal(prior.covariance, prior.covariance.t()));
  expect_precision(prior.covariance, prior.precs);
}

// Turning left and turning right are equally likely: swapping the sides leaves mean and covariance unchanged.
TEST(PosePrior, IsItsOwnMirrorImage) {
  std::vector<std::int64_t> twin(smal::kNumJoints);
  std::iota(twin.begin(), twin.end(), 0);
  for (const int left : {7, 8, 9, 10, 17, 18, 19, 20}) std::swap(twin[left], twin[left + 4]);
  std::swap(twin[33], twin[34]);
  torch::Tensor mirror = torch::zeros({105, 105});
  for (std::int64_t joint = 0; joint < smal::kNumJoints; ++joint) {
    const std::int64_t to = 3 * twin[static_cast<std::size_t>(joint)], from = 3 * joint;
    mirror[to][from] = -1.0;  // in z = 0, rotations about x and y change sign
    mirror[to + 1][from + 1] = -1.0;
    mirror[to + 2][from + 2] = 1.0;
  }
  const PosePrior prior = synthetic_pose_prior();
  EXPECT_LT(worst(torch::matmul(mirror, prior.mean), prior.mean), 1e-7);
  EXPECT_LT(worst(torch::matmul(torch::matmul(mirror, prior.covariance), mirror.t()), prior.covariance),
            1e-7);
}

TEST(PosePrior, SamplesStayInRangeAndFollowTheCovariance) {
  std::mt19937_64 random(23);
  const MotionModel model = synthetic_motion();
  constexpr int kSamples = 4000;
  std::vector<torch::Tensor> poses;
  for (int i = 0; i < kSamples; ++i) poses.push_back(sample_pose(random).flatten());
  const torch::Tensor all = torch::stack(poses);
  EXPECT_EQ(all.slice(1, 0, 3).abs().max().item<float>(), 0.0f);
  const torch::Tensor low = std::get<0>(all.min(0)), high = std::get<0>(all.max(0));
  for (Eigen::Index i = 0; i < kPoseSize; ++i) {
    EXPECT_GE(low[i].item<double>(), model.lower[i] - 1e-6);
    EXPECT_LE(high[i].item<double>(), model.upper[i] + 1e-6);
  }
  // Ranges cut the tails of some joints, so the samples spread less than the Gaussian, but not much less, and
  // never more.
  const PosePrior prior = synthetic_pose_prior();
  const torch::Tensor ratio = all.std(0).slice(0, 3) / prior.covariance.diagonal().sqrt().slice(0, 3);
  EXPECT_GT(ratio.min().item<double>(), 0.6);
  EXPECT_LT(ratio.max().item<double>(), 1.05);
  // The trot couples diagonal legs: left shoulder with right hip.
  const torch::Tensor centred = all - all.mean(0);
  const auto correlation = [&](int a, int b) {
    const torch::Tensor x = centred.select(1, a), y = centred.select(1, b);
    return ((x * y).mean() / (x.square().mean() * y.square().mean()).sqrt()).item<double>();
  };
  EXPECT_GT(correlation(3 * 7 + 2, 3 * 21 + 2), correlation(3 * 7 + 2, 3 * 17 + 2));
  EXPECT_LT(correlation(3 * 7 + 2, 3 * 11 + 2), -0.1);
}

TEST(ShapePrior, AgreesWithTheFamilies) {
  const ShapePrior prior = synthetic_shape_prior();
  EXPECT_EQ(prior.covariances.sizes(), torch::IntArrayRef({5, 41, 41}));
  EXPECT_TRUE(torch::equal(prior.means, synthetic_family_means()));
  EXPECT_LT(worst(prior.covariances.diagonal(0, 1, 2).mean(0).sqrt(), synthetic_betas_std()), 1e-6);
  for (std::int64_t f = 0; f < 5; ++f) expect_precision(prior.covariances[f], prior.precs[f]);
  // Between and within the families together, each beta has mean 0 and variance 1.
  const torch::Tensor variance = prior.means.square().mean(0) + synthetic_betas_std().square();
  EXPECT_LT(worst(variance, torch::ones({smal::kNumBetas})), 1e-5);
  EXPECT_LT(prior.means.mean(0).abs().max().item<double>(), 1e-6);
}

TEST(ShapePrior, SamplesSurroundTheirFamily) {
  std::mt19937_64 random(29);
  constexpr int kSamples = 2000;
  const ShapePrior prior = synthetic_shape_prior();
  for (std::int64_t f = 0; f < 5; ++f) {
    std::vector<torch::Tensor> betas;
    for (int i = 0; i < kSamples; ++i) betas.push_back(sample_betas(f, random));
    const torch::Tensor all = torch::stack(betas);
    const torch::Tensor spread = prior.covariances[f].diagonal().sqrt();
    const torch::Tensor off = (all.mean(0) - prior.means[f]).abs() / spread * std::sqrt(kSamples);
    EXPECT_LT(off.max().item<double>(), 4.5) << f;  // 41 standard normal numbers
    const torch::Tensor ratio = all.std(0) / spread;
    EXPECT_GT(ratio.min().item<double>(), 0.88) << f;  // cut off at 2.5 deviations
    EXPECT_LT(ratio.max().item<double>(), 1.08) << f;
  }
}

TEST(ShapePrior, SamplesAreRepeatable) {
  std::mt19937_64 a(5), b(5), c(6);
  const torch::Tensor betas = sample_betas(2, a);
  EXPECT_TRUE(torch::equal(betas, sample_betas(2, b)));
  EXPECT_FALSE(torch::equal(betas, sample_betas(2, c)));
  EXPECT_TRUE(torch::equal(sample_pose(a), sample_pose(b)));
}

TEST(ShapePrior, RefusesAnUnknownFamily) {
  std::mt19937_64 random(1);
  EXPECT_THROW(sample_betas(5, random), std::invalid_argument);
  EXPECT_THROW(sample_betas(-1, random), std::invalid_argument);
}

}  // namespace
}  // namespace q3d::pipeline::animal
