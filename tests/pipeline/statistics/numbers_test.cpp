#include "pipeline/statistics/numbers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace q3d::pipeline::statistics {
namespace {

using testing::ElementsAre;

TEST(Rounded, KeepsSignificantDigitsAndHasNullForNoNumber) {
  EXPECT_EQ(rounded(0.000123456789).dump(), "0.00012346");
  EXPECT_EQ(rounded(123456.7, 3).dump(), "123000.0");
  EXPECT_TRUE(rounded(std::numeric_limits<double>::quiet_NaN()).is_null());
  EXPECT_TRUE(rounded(std::optional<double>()).is_null());
}

// Wilson's interval of 8 of 10, by hand: (0.8 + 1.9208 / 10 +- 1.96 sqrt(0.016 + 0.96 / 100)) / 1.384, z
// = 1.96.
TEST(ShareOf, GivesWilsonsInterval) {
  const auto share = share_of(8, 10);
  ASSERT_TRUE(share.has_value());
  EXPECT_DOUBLE_EQ(share->share, 0.8);
  EXPECT_NEAR(share->low, 0.4902, 2e-4);
  EXPECT_NEAR(share->high, 0.9433, 2e-4);
  EXPECT_EQ(share_of(0, 5)->low, 0.0);
  EXPECT_FALSE(share_of(0, 0).has_value());
}

TEST(Quantile, InterpolatesAsNumpyDoes) {
  std::vector<double> values{4.0, 1.0, 3.0, 2.0};
  EXPECT_DOUBLE_EQ(*quantile(values, 0.5), 2.5);
  EXPECT_DOUBLE_EQ(*quantile(values, 0.25), 1.75);
  EXPECT_DOUBLE_EQ(*quantile(values, 1.0), 4.0);
  std::vector<double> none;
  EXPECT_FALSE(quantile(none, 0.5).has_value());
}

TEST(HistogramAdd, CountsEveryValueOnce) {
  Histogram histogram(0.0, 1.0, 4);
  for (const double value : {0.0, 0.1, 0.25, 0.9, 1.0, -0.1, 1.1, std::numeric_limits<double>::quiet_NaN()}) {
    histogram.add(value);
  }
  EXPECT_THAT(histogram.counts, ElementsAre(2, 1, 0, 2));
  EXPECT_EQ(histogram.below, 1);
  EXPECT_EQ(histogram.beyond, 1);
}

TEST(SpreadPositions, AreEvenAndAscend) {
  EXPECT_THAT(spread_positions(10, 4), ElementsAre(0, 2, 5, 7));
  EXPECT_THAT(spread_positions(3, 10), ElementsAre(0, 1, 2));
  EXPECT_TRUE(spread_positions(0, 10).empty());
}

}  // namespace
}  // namespace q3d::pipeline::statistics
