#include "pipeline/training/loss_watch.h"

#include <gtest/gtest.h>

#include <limits>

namespace q3d::pipeline::training {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(LossWatch, StopsAtNumbersThatAreNotFinite) {
  LossWatch watch;
  EXPECT_TRUE(watch.check(kNan, 1.0, 20.0));
  EXPECT_TRUE(watch.check(1.0, std::numeric_limits<double>::infinity(), 20.0));
  EXPECT_EQ(watch.seen, 0);
}

TEST(LossWatch, StopsWhenTheLossLeavesItsRunningMean) {
  LossWatch watch;
  for (int i = 0; i < 60; ++i) EXPECT_FALSE(watch.check(i % 2 == 0 ? 1.0 : 3.0, 1.0, 20.0));
  EXPECT_NEAR(watch.mean, 2.0, 1e-12);  // plain mean up to 100 losses
  EXPECT_FALSE(watch.check(39.0, 1.0, 20.0));
  EXPECT_TRUE(watch.check(60.0, 1.0, 20.0));
}

TEST(LossWatch, AllowsAWildStart) {
  LossWatch watch;
  EXPECT_FALSE(watch.check(1.0, 1.0, 20.0));
  EXPECT_FALSE(watch.check(1000.0, 1.0, 20.0));
}

}  // namespace
}  // namespace q3d::pipeline::training
