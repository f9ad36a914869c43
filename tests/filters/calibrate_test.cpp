// Thresholds are checked by what the fidelity rule then makes of the pool.
#include "filters/calibrate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

namespace q3d::filters {
namespace {

using manifests::Verdict;
using Pool = std::vector<CalibrationSample>;

struct Counts {
  int retained = 0;
  int refined = 0;
  int discarded = 0;
};

// A sample that passes shows a curve with a gain of one half; one that does not, a flat curve.
Counts judge(const Pool& pool, const Thresholds& thresholds) {
  Counts counts;
  for (const CalibrationSample& sample : pool) {
    manifests::Judgement judgement = judge_initial(sample.initial_error, thresholds);
    if (band(sample.initial_error, thresholds) == Band::refine) {
      const double next = sample.passes_adaptation ? sample.initial_error / 2 : sample.initial_error;
      judgement = judge_adapted(std::vector{sample.initial_error, next}, thresholds);
    }
    counts.retained += judgement.verdict == Verdict::retained;
    counts.refined += judgement.verdict == Verdict::refined;
    counts.discarded += judgement.verdict == Verdict::discarded;
  }
  return counts;
}

void expect_shares_are_true(const Calibration& result, const Pool& pool) {
  const Counts counts = judge(pool, result.thresholds);
  const auto n = static_cast<double>(pool.size());
  EXPECT_DOUBLE_EQ(result.retained, counts.retained / n);
  EXPECT_DOUBLE_EQ(result.refined, counts.refined / n);
  EXPECT_NEAR(result.discarded, counts.discarded / n, 1e-12);
}

TEST(Calibrate, GivesThePapersSharesOnFourteenSamples) {
  Pool pool;
  for (int i = 14; i >= 1; --i) pool.push_back({0.01 * i, true});
  const Calibration result = calibrate(pool, {}, {});
  EXPECT_TRUE(result.reached);
  EXPECT_NEAR(result.thresholds.tau_low, 0.055, 1e-12) << "halfway between the 5th and the 6th";
  EXPECT_NEAR(result.thresholds.tau_high, 0.095, 1e-12) << "halfway between the 9th and the 10th";
  EXPECT_DOUBLE_EQ(result.retained, 5.0 / 14.0);
  EXPECT_DOUBLE_EQ(result.refined, 4.0 / 14.0);
  EXPECT_NEAR(result.discarded, 5.0 / 14.0, 1e-12);
}

TEST(Calibrate, SamplesThatFailAdaptationWidenTheMiddleBand) {
  Pool pool;
  for (int i = 1; i <= 14; ++i) pool.push_back({0.01 * i, i % 2 == 0});
  const Calibration result = calibrate(pool, {}, {});
  // From the 6th on, the 6th, 8th, 10th and 12th pass; the 13th, which fails, stays out.
  EXPECT_NEAR(result.thresholds.tau_high, 0.125, 1e-12);
  EXPECT_TRUE(result.reached);
  expect_shares_are_true(result, pool);
}

TEST(Calibrate, KeepsDeltaWindowAndIterationsOfTheBase) {
  Thresholds base;
  base.delta = 0.125;
  base.gain_window = 7;
  base.iterations_min = 3;
  base.iterations_max = 5;
  const Calibration result = calibrate(Pool{{0.1, true}, {0.2, true}, {0.3, true}}, {0.34, 0.33}, base);
  EXPECT_EQ(result.thresholds.delta, 0.125);
  EXPECT_EQ(result.thresholds.gain_window, 7);
  EXPECT_EQ(result.thresholds.iterations_min, 3);
  EXPECT_EQ(result.thresholds.iterations_max, 5);
}

TEST(Calibrate, RandomPoolsMeetTheirTargetsWithinOneSample) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int trial = 0; trial < 300; ++trial) {
    const int size = 3 + static_cast<int>(uniform(random) * 400);
    const double pass_rate = 0.5 + 0.5 * uniform(random);
    Pool pool;
    for (int i = 0; i < size; ++i) {
      pool.push_back({std::exp(3 * uniform(random) - 4), uniform(random) < pass_rate});
    }
    const TargetShares shares{0.1 + 0.3 * uniform(random), 0.05 + 0.15 * uniform(random)};
    const Calibration result = calibrate(pool, shares, {});
    SCOPED_TRACE(trial);
    check(result.thresholds);
    expect_shares_are_true(result, pool);
    const Counts counts = judge(pool, result.thresholds);
    EXPECT_LE(std::abs(counts.retained - shares.retained * size), 0.5 + 1e-9);
    // It takes as many as there are.
    const auto passing = std::count_if(pool.begin(), pool.end(), [&](const auto& sample) {
      return sample.passes_adaptation && sample.initial_error >= result.thresholds.tau_low;
    });
    const double wanted = std::min(shares.refined * size, static_cast<double>(passing));
    EXPECT_LE(std::abs(counts.refined - wanted), 0.5 + 1e-9);
    if (static_cast<double>(passing) >= shares.refined * size) {
      EXPECT_TRUE(result.reached);
    }
  }
}

// Errors from a coarse grid: no positive threshold pair may come closer than the one that was chosen.
TEST(Calibrate, TiesAreMetAsCloselyAsAnyThresholdsCould) {
  std::mt19937 random(11);
  for (int trial = 0; trial < 200; ++trial) {
    const int size = 1 + static_cast<int>(random() % 30);
    Pool pool;
    for (int i = 0; i < size; ++i)
      pool.push_back({0.125 * static_cast<double>(random() % 5), random() % 3 != 0});
    const TargetShares shares{0.4, 0.3};
    const Calibration result = calibrate(pool, shares, {});
    SCOPED_TRACE(trial);
    check(result.thresholds);
    expect_shares_are_true(result, pool);
    const auto off_low = [&](double tau_low) {
      Thresholds t;
      t.tau_low = t.tau_high = tau_low;
      return std::abs(judge(pool, t).retained - shares.retained * size);
    };
    const auto off_high = [&](double tau_high) {
      Thresholds t;
      t.tau_low = result.thresholds.tau_low;
      t.tau_high = std::max(t.tau_low, tau_high);
      return std::abs(judge(pool, t).refined - shares.refined * size);
    };
    for (double tau = 0.0625; tau < 0.7; tau += 0.125) {
      EXPECT_LE(off_low(result.thresholds.tau_low), off_low(tau) + 1e-9) << tau;
      EXPECT_LE(off_high(result.thresholds.tau_high), off_high(tau) + 1e-9) << tau;
    }
    const bool close = off_low(result.thresholds.tau_low) <= 1 && off_high(result.thresholds.tau_high) <= 1;
    EXPECT_EQ(result.reached, close);
  }
}

TEST(Calibrate, SaysWhenTooFewPass) {
  Pool pool;
  for (int i = 1; i <= 28; ++i) pool.push_back({0.01 * i, i == 15 || i == 20});
  const Calibration result = calibrate(pool, {}, {});
  EXPECT_FALSE(result.reached);
  EXPECT_DOUBLE_EQ(result.retained, 10.0 / 28.0);
  EXPECT_DOUBLE_EQ(result.refined, 2.0 / 28.0);
  EXPECT_NEAR(result.thresholds.tau_high, 0.205, 1e-12) << "no wider than the last one that passes";
  expect_shares_are_true(result, pool);
}

TEST(Calibrate, SaysWhenNonePasses) {
  const Pool pool{{0.1, false}, {0.2, false}, {0.3, false}, {0.4, false}};
  const Calibration result = calibrate(pool, {0.25, 0.5}, {});
  EXPECT_FALSE(result.reached);
  EXPECT_EQ(result.thresholds.tau_low, result.thresholds.tau_high);
  EXPECT_EQ(result.refined, 0.0);
  expect_shares_are_true(result, pool);
}

TEST(Calibrate, SaysWhenAllErrorsAreEqual) {
  const Pool pool(10, {0.5, true});
  const Calibration result = calibrate(pool, {}, {});
  EXPECT_FALSE(result.reached);
  expect_shares_are_true(result, pool);
}

TEST(Calibrate, ErrorsOfZeroAreAlwaysRetained) {
  const Pool pool(10, {0.0, true});
  const Calibration result = calibrate(pool, {}, {});
  EXPECT_GT(result.thresholds.tau_low, 0.0);
  EXPECT_EQ(result.retained, 1.0);
}

TEST(Calibrate, OneSampleIsAPool) {
  expect_shares_are_true(calibrate(Pool{{0.5, true}}, {}, {}), {{0.5, true}});
}

TEST(Calibrate, RefusesBadInput) {
  const Pool pool{{0.5, true}};
  EXPECT_THROW(calibrate({}, {}, {}), std::invalid_argument);
  EXPECT_THROW(calibrate(pool, {0.0, 0.5}, {}), std::invalid_argument);
  EXPECT_THROW(calibrate(pool, {0.5, 0.0}, {}), std::invalid_argument);
  EXPECT_THROW(calibrate(pool, {0.5, 0.5}, {}), std::invalid_argument);
  EXPECT_THROW(calibrate(pool, {std::nan(""), 0.5}, {}), std::invalid_argument);
  EXPECT_THROW(calibrate(Pool{{std::nan(""), true}}, {}, {}), std::invalid_argument);
  EXPECT_THROW(calibrate(Pool{{-0.1, true}}, {}, {}), std::invalid_argument);
  EXPECT_THROW(calibrate(Pool{{std::numeric_limits<double>::infinity(), true}}, {}, {}),
               std::invalid_argument);
}

}  // namespace
}  // namespace q3d::filters
