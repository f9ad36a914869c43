// The rules of test-time adaptation, on the network and the samples of fixture A. Its numbers are checked in
// tta_parity_test.cpp.
#include "model/tta.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "model/net.h"
#include "smal/tensors/rotation.h"
#include "tests/model/parity_net.h"

namespace q3d::model {
namespace {

using filters::adaptation::Schedule;

constexpr double kBatchNoise = 2e-4;  // of rotations, after some steps at a large rate

struct Samples {
  Prima prima = testing::parity_prima("A");
  smal::tensors::SafeTensors file = testing::parity_file("tta_A");
  ImageFeatures features = prima.encode(testing::parity_images(prima, file.tensor("input_index")));
  torch::Tensor keypoints = file.tensor("gt_keypoints").clone();
};

class Tta : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { samples_ = new Samples; }
  static void TearDownTestSuite() { delete samples_; }

  static TtaOptions fast() {
    TtaOptions options;
    options.learning_rate = 1e-3;
    return options;
  }

  static Schedule steps(int iterations) {
    Schedule schedule;
    schedule.iterations = iterations;
    return schedule;
  }

  static std::vector<Schedule> all(const Schedule& schedule) {
    return std::vector<Schedule>(static_cast<std::size_t>(samples_->keypoints.size(0)), schedule);
  }

  static TtaResult run(const torch::Tensor& keypoints, const std::vector<Schedule>& schedules) {
    return adapt(samples_->prima, samples_->features, keypoints, schedules, fast());
  }

  static void expect_near(const torch::Tensor& a, const torch::Tensor& b, double tolerance) {
    ASSERT_EQ(a.sizes(), b.sizes());
    EXPECT_LE((a - b).abs().max().item<double>(), tolerance);
  }

  static inline Samples* samples_ = nullptr;
};

TEST_F(Tta, IterateZeroIsThePrediction) {
  const Prediction before = samples_->prima.predict(samples_->features);
  const TtaResult result = run(samples_->keypoints, all(steps(0)));
  expect_near(result.best.rotations, before.rotations, 1e-5);
  expect_near(result.last.keypoints_2d, before.keypoints_2d, 1e-5);
  const torch::Tensor visible = samples_->keypoints.select(2, 2) > 0;
  const torch::Tensor error = (before.keypoints_2d - samples_->keypoints.narrow(2, 0, 2)).abs().sum(2);
  for (std::int64_t i = 0; i < visible.size(0); ++i) {
    const auto index = static_cast<std::size_t>(i);
    ASSERT_EQ(result.l_proj[index].size(), 1U);
    const double by_hand = error[i].masked_select(visible[i]).mean().item<double>() / 2.0;
    EXPECT_NEAR(result.l_proj[index][0], by_hand, 1e-6);
    EXPECT_EQ(result.best_iteration[index], 0);
  }
}

TEST_F(Tta, KeepsTheBestIterate) {
  const TtaResult result = run(samples_->keypoints, all(steps(12)));
  for (std::size_t i = 0; i < result.l_proj.size(); ++i) {
    const auto& curve = result.l_proj[i];
    ASSERT_EQ(curve.size(), 13U);
    ASSERT_EQ(result.loss[i].size(), 13U);
    const auto least = std::min_element(curve.begin(), curve.end());
    EXPECT_EQ(result.best_iteration[i], least - curve.begin());
    const auto row = static_cast<std::int64_t>(i);
    const torch::Tensor keypoints = samples_->keypoints[row];
    const torch::Tensor visible = keypoints.select(1, 2) > 0;
    const torch::Tensor error = (result.best.keypoints_2d[row] - keypoints.narrow(1, 0, 2)).abs().sum(1);
    EXPECT_NEAR(error.masked_select(visible).mean().item<double>() / 2.0, *least, 1e-6);
  }
}

// A snapshot is what a run of that length ends with; beyond the run it is the last iterate.
TEST_F(Tta, SnapshotsAreTheIteratesAskedFor) {
  TtaOptions options = fast();
  options.snapshots = {0, 3, 6, 9};
  const TtaResult result =
      adapt(samples_->prima, samples_->features, samples_->keypoints, all(steps(6)), options);
  ASSERT_EQ(result.snapshots.size(), 4U);
  const std::vector<int> lengths{0, 3, 6, 6};
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    const TtaResult shorter = run(samples_->keypoints, all(steps(lengths[i])));
    expect_near(result.snapshots[i].rotations, shorter.last.rotations, kBatchNoise);
    expect_near(result.snapshots[i].keypoints_2d, shorter.last.keypoints_2d, kBatchNoise);
  }
  EXPECT_GT((result.snapshots[1].rotations - result.snapshots[2].rotations).abs().max().item<double>(),
            10 * kBatchNoise);
  options.snapshots = {3, 0};
  EXPECT_THROW(adapt(samples_->prima, samples_->features, samples_->keypoints, all(steps(6)), options),
               std::invalid_argument);
}

// Four lengths in one batch, so slots are emptied and refilled; each as if it had run alone.
TEST_F(Tta, InstancesDoNotFeelTheirBatchMates) {
  const std::vector<Schedule> schedules{steps(3), steps(12), steps(0), steps(7)};
  const TtaResult together = run(samples_->keypoints, schedules);
  for (std::int64_t i = 0; i < 4; ++i) {
    const auto index = static_cast<std::size_t>(i);
    const ImageFeatures features{samples_->features.image_tokens.narrow(0, i, 1),
                                 samples_->features.bio_token.narrow(0, i, 1)};
    const TtaResult alone =
        adapt(samples_->prima, features, samples_->keypoints.narrow(0, i, 1), {schedules[index]}, fast());
    ASSERT_EQ(together.l_proj[index].size(), static_cast<std::size_t>(schedules[index].iterations) + 1);
    ASSERT_EQ(alone.l_proj[0].size(), together.l_proj[index].size());
    for (std::size_t step = 0; step < alone.l_proj[0].size(); ++step) {
      EXPECT_NEAR(alone.l_proj[0][step], together.l_proj[index][step], 1e-5);
      EXPECT_NEAR(alone.loss[0][step], together.loss[index][step], 1e-4);
    }
    expect_near(alone.last.rotations[0], together.last.rotations[i], kBatchNoise);
    expect_near(alone.last.betas[0], together.last.betas[i], kBatchNoise);
    expect_near(alone.best.keypoints_2d[0], together.best.keypoints_2d[i], kBatchNoise);
  }
}

// With two slots, the third and the fourth instance start when others have ended. Each is as if it had run
// alone, in its own place in the results, and one without keypoints leaves its slot at once.
TEST_F(Tta, FreedSlotsGoToTheNextInstances) {
  const std::vector<Schedule> schedules{steps(3), steps(9), steps(5), steps(7)};
  torch::Tensor keypoints = samples_->keypoints.clone();
  keypoints[2].select(1, 2).fill_(0.0);
  TtaOptions options = fast();
  options.snapshots = {0, 4};
  const TtaResult all_at_once = adapt(samples_->prima, samples_->features, keypoints, schedules, options);
  std::vector<std::int64_t> told;
  options.slots = 2;
  options.progress = [&](std::int64_t finished) { told.push_back(finished); };
  const TtaResult queued = adapt(samples_->prima, samples_->features, keypoints, schedules, options);
  // The first ends after 3 steps, the third at its first iterate, and the fourth, with 7 steps left, after
  // the second.
  EXPECT_EQ(told, (std::vector<std::int64_t>{1, 2, 3, 4}));
  EXPECT_TRUE(queued.l_proj[2].empty());
  for (std::size_t i = 0; i < 4; ++i) {
    const auto row = static_cast<std::int64_t>(i);
    ASSERT_EQ(queued.l_proj[i].size(), all_at_once.l_proj[i].size());
    EXPECT_EQ(queued.best_iteration[i], all_at_once.best_iteration[i]);
    expect_near(queued.last.rotations[row], all_at_once.last.rotations[row], kBatchNoise);
    expect_near(queued.best.keypoints_2d[row], all_at_once.best.keypoints_2d[row], kBatchNoise);
    for (std::size_t s = 0; s < 2; ++s) {
      expect_near(queued.snapshots[s].rotations[row], all_at_once.snapshots[s].rotations[row], kBatchNoise);
    }
  }
}

TEST_F(Tta, StopsBelowTheThreshold) {
  const TtaResult free = run(samples_->keypoints, all(steps(12)));
  std::vector<Schedule> schedules = all(steps(12));
  for (std::size_t i = 0; i < schedules.size(); ++i) {
    // Between the first iterate and the best one, or never reached where nothing improves.
    const double least = *std::min_element(free.l_proj[i].begin(), free.l_proj[i].end());
    schedules[i].stop_below = 0.5 * (free.l_proj[i][0] + least);
  }
  const TtaResult stopped = run(samples_->keypoints, schedules);
  for (std::size_t i = 0; i < schedules.size(); ++i) {
    const auto& curve = free.l_proj[i];
    const auto below = std::find_if(curve.begin(), curve.end(),
                                    [&](double value) { return value < schedules[i].stop_below; });
    const auto expected = std::min<std::ptrdiff_t>(below - curve.begin() + 1, 13);
    EXPECT_EQ(static_cast<std::ptrdiff_t>(stopped.l_proj[i].size()), expected) << i;
  }
}

TEST_F(Tta, StopsAtOnceWhenAlreadyBelow) {
  Schedule schedule = steps(12);
  schedule.stop_below = 10.0;
  for (const auto& curve : run(samples_->keypoints, all(schedule)).l_proj) EXPECT_EQ(curve.size(), 1U);
}

TEST_F(Tta, GivesUpWithoutGain) {
  Schedule schedule = steps(12);
  schedule.gain_window = 4;
  schedule.min_gain = 0.999;
  for (const auto& curve : run(samples_->keypoints, all(schedule)).l_proj) EXPECT_EQ(curve.size(), 5U);
  schedule.min_gain = 1e-9;
  const TtaResult kept = run(samples_->keypoints, all(schedule));
  for (const auto& curve : kept.l_proj) {
    const double least = *std::min_element(curve.begin() + 1, curve.begin() + 5);
    EXPECT_EQ(curve.size(), least < curve[0] ? 13U : 5U);
  }
}

// Takes the first `count` visible keypoints of every instance.
std::vector<std::vector<std::int64_t>> first_visible(const torch::Tensor& keypoints, std::size_t count) {
  std::vector<std::vector<std::int64_t>> chosen(static_cast<std::size_t>(keypoints.size(0)));
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    for (std::int64_t k = 0; k < kKeypoints && chosen[i].size() < count; ++k) {
      if (keypoints[static_cast<std::int64_t>(i)][k][2].item<double>() > 0) chosen[i].push_back(k);
    }
  }
  return chosen;
}

// The steps are those of the same sample with the held-out keypoints hidden, and the curves are of all
// visible ones and of the held-out ones alone.
TEST_F(Tta, HeldOutKeypointsAreMeasuredAndNotFitted) {
  const auto held_out = first_visible(samples_->keypoints, 2);
  std::vector<Schedule> schedules = all(steps(6));
  torch::Tensor hidden = samples_->keypoints.clone();
  for (std::size_t i = 0; i < held_out.size(); ++i) {
    for (const std::int64_t k : held_out[i]) {
      schedules[i].held_out[static_cast<std::size_t>(k)] = true;
      hidden[static_cast<std::int64_t>(i)][k][2] = 0.0;
    }
  }
  const TtaResult result = run(samples_->keypoints, schedules);
  const TtaResult blind = run(hidden, all(steps(6)));
  expect_near(result.last.rotations, blind.last.rotations, kBatchNoise);
  for (std::size_t i = 0; i < held_out.size(); ++i) {
    const auto row = static_cast<std::int64_t>(i);
    ASSERT_EQ(result.held_out[i].size(), 7U);
    EXPECT_TRUE(blind.held_out[i].empty());
    for (std::size_t step = 0; step < 7; ++step) EXPECT_NEAR(result.loss[i][step], blind.loss[i][step], 1e-4);
    const torch::Tensor keypoints = samples_->keypoints[row];
    const torch::Tensor error =
        (result.last.keypoints_2d[row] - keypoints.narrow(1, 0, 2)).abs().sum(1) / 2.0;
    double of_held_out = 0.0;
    for (const std::int64_t k : held_out[i]) of_held_out += error[k].item<double>() / 2.0;
    EXPECT_NEAR(result.held_out[i].back(), of_held_out, 1e-6);
    const torch::Tensor visible = keypoints.select(1, 2) > 0;
    EXPECT_NEAR(result.l_proj[i].back(), error.masked_select(visible).mean().item<double>(), 1e-6);
  }
}

TEST_F(Tta, TheBestIterateIsThatOfTheHeldOutKeypoints) {
  const auto held_out = first_visible(samples_->keypoints, 2);
  std::vector<Schedule> schedules = all(steps(12));
  for (std::size_t i = 0; i < 3; ++i) {  // the last instance holds out none
    for (const std::int64_t k : held_out[i]) schedules[i].held_out[static_cast<std::size_t>(k)] = true;
  }
  const TtaResult result = run(samples_->keypoints, schedules);
  for (std::size_t i = 0; i < 4; ++i) {
    const std::vector<double>& judged = i < 3 ? result.held_out[i] : result.l_proj[i];
    const auto least = std::min_element(judged.begin(), judged.end()) - judged.begin();
    EXPECT_EQ(result.best_iteration[i], least);
    if (i == 3) continue;
    const auto row = static_cast<std::int64_t>(i);
    double error = 0.0;
    for (const std::int64_t k : held_out[i]) {
      const torch::Tensor difference =
          result.best.keypoints_2d[row][k] - samples_->keypoints[row][k].narrow(0, 0, 2);
      error += difference.abs().mean().item<double>() / 2.0;
    }
    EXPECT_NEAR(error, judged[static_cast<std::size_t>(least)], 1e-6);
  }
  EXPECT_TRUE(result.held_out[3].empty());
}

TEST_F(Tta, PatienceEndsWithTheHeldOutError) {
  const auto held_out = first_visible(samples_->keypoints, 2);
  std::vector<Schedule> schedules = all(steps(12));
  for (std::size_t i = 0; i < 4; ++i) {
    for (const std::int64_t k : held_out[i]) schedules[i].held_out[static_cast<std::size_t>(k)] = true;
  }
  const TtaResult free = run(samples_->keypoints, schedules);
  for (Schedule& schedule : schedules) schedule.patience = 2;
  const TtaResult stopped = run(samples_->keypoints, schedules);
  for (std::size_t i = 0; i < 4; ++i) {
    std::size_t best = 0;
    std::size_t end = 0;
    while (end < 12 && end - best < 2) {
      ++end;
      if (free.held_out[i][end] < free.held_out[i][best]) best = end;
    }
    EXPECT_EQ(stopped.held_out[i].size(), end + 1) << i;
    EXPECT_EQ(stopped.best_iteration[i], static_cast<int>(best)) << i;
  }
}

TEST_F(Tta, NothingVisibleLeavesTheInstanceAlone) {
  const Prediction before = samples_->prima.predict(samples_->features);
  torch::Tensor keypoints = samples_->keypoints.clone();
  keypoints[1].select(1, 2).fill_(0.0);
  const TtaResult result = run(keypoints, all(steps(5)));
  EXPECT_TRUE(result.l_proj[1].empty());
  EXPECT_TRUE(result.loss[1].empty());
  EXPECT_EQ(result.best_iteration[1], 0);
  expect_near(result.last.rotations[1], before.rotations[1], 1e-5);
  EXPECT_EQ(result.l_proj[0].size(), 6U);
  EXPECT_GT((result.last.rotations[0] - before.rotations[0]).abs().max().item<double>(), 1e-4);
}

TEST_F(Tta, WeightsSayVisibleAndNothingMore) {
  torch::Tensor heavier = samples_->keypoints.clone();
  heavier.select(2, 2).mul_(2.0);
  const TtaResult once = run(samples_->keypoints, all(steps(3)));
  const TtaResult twice = run(heavier, all(steps(3)));
  EXPECT_EQ(once.loss, twice.loss);
}

TEST_F(Tta, GarbageInInvisiblePointsIsIgnored) {
  torch::Tensor keypoints = samples_->keypoints.clone();
  const torch::Tensor hidden = keypoints.select(2, 2) <= 0;
  ASSERT_TRUE(hidden.any().item<bool>());
  keypoints.narrow(2, 0, 2).masked_fill_(hidden.unsqueeze(2), std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(run(keypoints, all(steps(3))).loss, run(samples_->keypoints, all(steps(3))).loss);
}

TEST_F(Tta, NonFiniteTargetsTouchNoOtherInstance) {
  const TtaResult clean = run(samples_->keypoints, all(steps(4)));
  torch::Tensor keypoints = samples_->keypoints.clone();
  keypoints[0][0][0] = std::numeric_limits<float>::quiet_NaN();
  keypoints[0][0][2] = 1.0;
  const TtaResult result = run(keypoints, all(steps(4)));
  EXPECT_TRUE(result.l_proj[0].empty());
  EXPECT_TRUE(result.last.rotations.isfinite().all().item<bool>());
  for (std::size_t i = 1; i < 4; ++i) {
    ASSERT_EQ(result.l_proj[i].size(), 5U);
    EXPECT_NEAR(result.l_proj[i].back(), clean.l_proj[i].back(), 1e-5);
  }
}

TEST_F(Tta, ExplodingStepsKeepTheLastFiniteIterate) {
  TtaOptions wild = fast();
  wild.learning_rate = 1e30;
  const Prediction before = samples_->prima.predict(samples_->features);
  const TtaResult result =
      adapt(samples_->prima, samples_->features, samples_->keypoints, all(steps(6)), wild);
  for (std::size_t i = 0; i < 4; ++i) {
    ASSERT_GE(result.l_proj[i].size(), 1U);
    EXPECT_LT(result.l_proj[i].size(), 7U) << "nothing exploded";
    for (const double value : result.l_proj[i]) EXPECT_TRUE(std::isfinite(value));
    for (const double value : result.loss[i]) EXPECT_TRUE(std::isfinite(value));
  }
  for (const Prediction* kept : {&result.best, &result.last}) {
    EXPECT_TRUE(kept->rotations.isfinite().all().item<bool>());
    EXPECT_TRUE(kept->betas.isfinite().all().item<bool>());
    EXPECT_TRUE(kept->keypoints_2d.isfinite().all().item<bool>());
  }
  expect_near(result.best.rotations, before.rotations, 1e-5);
}

// Priors that know nothing but their means: no pose and the betas of one family, each with unit variance.
Priors unit_priors() {
  Priors priors;
  priors.mean_pose = torch::zeros({kPose6d / 2});
  priors.precs = torch::eye(kPose6d / 2);
  priors.use_index = torch::ones({kPose6d / 2});
  priors.mean_betas = torch::full({1, kBetas}, 0.5);
  priors.betas_prec = torch::eye(kBetas).unsqueeze(0);
  return priors;
}

TEST_F(Tta, PriorTermsAreMeanSquaresOfPoseAndBetas) {
  TtaOptions options = fast();
  options.priors = unit_priors();
  const auto first_loss = [&] {
    const TtaResult result =
        adapt(samples_->prima, samples_->features, samples_->keypoints, all(steps(0)), options);
    std::vector<double> losses;
    for (const auto& curve : result.loss) losses.push_back(curve.at(0));
    return torch::tensor(losses, torch::kFloat64);
  };
  const torch::Tensor without = first_loss();
  options.pose_prior_weight = 2.0;
  options.shape_prior_weight = 3.0;
  const torch::Tensor with = first_loss();
  const Prediction before = samples_->prima.predict(samples_->features);
  const torch::Tensor pose = smal::tensors::matrix_to_axis_angle_smooth(before.rotations).flatten(1);
  const torch::Tensor by_hand = 2.0 * pose.square().mean(1) + 3.0 * (before.betas - 0.5).square().mean(1);
  expect_near(with - without, by_hand.to(torch::kFloat64), 1e-4);
}

TEST_F(Tta, PriorTermsPullTheBodyTowardsTheirMeans) {
  TtaOptions options = fast();
  options.priors = unit_priors();
  const auto pose_size = [&] {
    const TtaResult result =
        adapt(samples_->prima, samples_->features, samples_->keypoints, all(steps(10)), options);
    return smal::tensors::matrix_to_axis_angle_smooth(result.last.rotations).square().mean().item<double>();
  };
  const double without = pose_size();
  options.pose_prior_weight = 10.0;
  EXPECT_LT(pose_size(), 0.99 * without);
}

TEST_F(Tta, LeavesTheNetworkAsItWas) {
  std::vector<torch::Tensor> before;
  for (const auto& parameter : samples_->prima.net().parameters()) before.push_back(parameter.clone());
  run(samples_->keypoints, all(steps(3)));
  const auto after = samples_->prima.net().parameters();
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_TRUE(torch::equal(before[i], after[i]));
    EXPECT_FALSE(after[i].grad().defined());
  }
}

TEST_F(Tta, WrongArgumentsAreRefused) {
  const torch::Tensor& keypoints = samples_->keypoints;
  EXPECT_THROW(run(keypoints.narrow(1, 0, 25), all(steps(1))), std::invalid_argument);
  EXPECT_THROW(run(keypoints.narrow(0, 0, 3), all(steps(1))), std::invalid_argument);
  EXPECT_THROW(run(keypoints, {steps(1)}), std::invalid_argument);
  EXPECT_THROW(run(keypoints, all(steps(-1))), std::invalid_argument);
  Schedule all_held_out = steps(1);
  all_held_out.held_out.fill(true);
  EXPECT_THROW(run(keypoints, all(all_held_out)), std::invalid_argument);
  TtaOptions options = fast();
  options.learning_rate = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(adapt(samples_->prima, samples_->features, keypoints, all(steps(1)), options),
               std::invalid_argument);
  options = fast();
  options.pose_prior_weight = 1.0;
  EXPECT_THROW(adapt(samples_->prima, samples_->features, keypoints, all(steps(1)), options),
               std::invalid_argument)
      << "no priors";
  samples_->prima.net().train();
  EXPECT_THROW(run(keypoints, all(steps(1))), std::invalid_argument);
  samples_->prima.net().eval();
}

}  // namespace
}  // namespace q3d::model
