#include "pipeline/feed/draw_sequence.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <stdexcept>

namespace q3d::pipeline::feed {
namespace {

TEST(DrawSequence, PoolsAreDrawnByTheWeightOfTheirSamples) {
  // The paper's weights: shares 100 * 1.0 : 300 * 0.5 : 1000 * 0.15 = 1 : 1.5 : 1.5.
  const DrawSequence draws({{100, 1.0}, {300, 0.5}, {1000, 0.15}}, 7);
  constexpr int kDraws = 40000;
  std::array<int, 3> counts{};
  std::array<std::set<std::int64_t>, 3> seen;
  for (int i = 0; i < kDraws; ++i) {
    const Draw draw = draws.at(i);
    ++counts.at(draw.pool);
    seen.at(draw.pool).insert(draw.sample);
  }
  const std::array<double, 3> shares{0.25, 0.375, 0.375};
  for (std::size_t pool = 0; pool < 3; ++pool) {
    const double deviation = std::sqrt(kDraws * shares[pool] * (1.0 - shares[pool]));
    EXPECT_NEAR(counts[pool], kDraws * shares[pool], 4.0 * deviation);
  }
  // 10000 draws of 100 samples miss one with probability e^-100; of 1000 by 15000 draws, 3e-7.
  EXPECT_EQ(seen[0].size(), 100U);
  EXPECT_EQ(*seen[0].rbegin(), 99);
  EXPECT_EQ(seen[2].size(), 1000U);
}

TEST(DrawSequence, DependsOnSeedAndPositionAlone) {
  const DrawSequence first({{10, 1.0}, {20, 1.0}}, 1), again({{10, 1.0}, {20, 1.0}}, 1),
      other({{10, 1.0}, {20, 1.0}}, 2);
  int same = 0;
  for (const std::int64_t position : {5000, 3, 0, 123456789}) {
    const Draw a = first.at(position), b = again.at(position), c = other.at(position);
    EXPECT_EQ(a.pool, b.pool);
    EXPECT_EQ(a.sample, b.sample);
    EXPECT_EQ(a.seed, b.seed);
    same += a.seed == c.seed ? 1 : 0;
  }
  EXPECT_EQ(same, 0);
}

TEST(DrawSequence, EmptyAndWeightlessPoolsAreNeverDrawn) {
  const DrawSequence draws({{0, 1.0}, {5, 1.0}, {5, 0.0}}, 3);
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(draws.at(i).pool, 1U);
  EXPECT_THROW(DrawSequence({{0, 1.0}, {5, 0.0}}, 3), std::invalid_argument);
  EXPECT_THROW(DrawSequence({{5, -1.0}}, 3), std::invalid_argument);
}

}  // namespace
}  // namespace q3d::pipeline::feed
