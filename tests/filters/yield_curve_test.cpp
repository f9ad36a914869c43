#include "filters/yield_curve.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

namespace q3d::filters {
namespace {

const std::vector<ScoredSample> kPool{{0.4, 50.0}, {0.1, 90.0}, {0.3, 60.0}, {0.2, 80.0}};

TEST(YieldAt, TakesWhatLiesBelow) {
  const YieldPoint point = yield_at(kPool, 0.3);
  EXPECT_DOUBLE_EQ(point.tau, 0.3);
  EXPECT_DOUBLE_EQ(point.yield, 0.5);
  EXPECT_DOUBLE_EQ(point.auc, 85.0);
  EXPECT_DOUBLE_EQ(yield_at(kPool, 1.0).auc, 70.0);
  EXPECT_DOUBLE_EQ(yield_at(kPool, 0.1).yield, 0.0);
  EXPECT_TRUE(std::isnan(yield_at(kPool, 0.1).auc));
  EXPECT_THROW(yield_at({}, 0.1), std::invalid_argument);
}

TEST(YieldCurve, EachPointIsWhatItsThresholdLetsThrough) {
  const std::vector<YieldPoint> curve = yield_curve(kPool, 4);
  ASSERT_EQ(curve.size(), 4U);
  const std::vector<double> aucs{90.0, 85.0, 230.0 / 3.0, 70.0};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_DOUBLE_EQ(curve[i].yield, 0.25 * static_cast<double>(i + 1));
    EXPECT_DOUBLE_EQ(curve[i].auc, aucs[i]);
    EXPECT_DOUBLE_EQ(yield_at(kPool, curve[i].tau).yield, curve[i].yield);
  }
}

TEST(YieldCurve, HasNoMorePointsThanAskedForAndEndsWithAll) {
  std::vector<ScoredSample> pool;
  for (int i = 0; i < 1000; ++i) pool.push_back({0.001 * i, 50.0});
  const auto curve = yield_curve(pool, 10);
  ASSERT_EQ(curve.size(), 10U);
  EXPECT_DOUBLE_EQ(curve[0].yield, 0.1);
  EXPECT_DOUBLE_EQ(curve[9].yield, 1.0);
}

TEST(YieldCurve, DoesNotPartEqualErrors) {
  const auto curve = yield_curve(std::vector<ScoredSample>{{0.1, 10}, {0.1, 20}, {0.1, 30}, {0.2, 40}}, 4);
  ASSERT_EQ(curve.size(), 2U);
  EXPECT_DOUBLE_EQ(curve[0].yield, 0.75);
  EXPECT_DOUBLE_EQ(curve[0].auc, 20.0);
}

TEST(YieldCurve, RefusesWhatIsNotFinite) {
  EXPECT_THROW(yield_curve({}, 3), std::invalid_argument);
  EXPECT_THROW(yield_curve(kPool, 0), std::invalid_argument);
  EXPECT_THROW(yield_curve(std::vector<ScoredSample>{{std::numeric_limits<double>::quiet_NaN(), 1.0}}, 1),
               std::invalid_argument);
}

}  // namespace
}  // namespace q3d::filters
