#include "filters/clustering.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <set>
#include <stdexcept>
#include <vector>

namespace q3d::filters {
namespace {

using Labels = std::vector<int>;

TEST(AdjustedRandIndex, MatchesHandComputedPartitions) {
  // Pairs together in both 1, in a 1, in b 2, of 6: (1 - 1/3) / (3/2 - 1/3) = 4/7.
  EXPECT_DOUBLE_EQ(adjusted_rand_index(Labels{0, 0, 1, 2}, Labels{0, 0, 1, 1}), 4.0 / 7.0);
  // 0, 2, 2 of 6: (0 - 2/3) / (2 - 2/3) = -1/2.
  EXPECT_DOUBLE_EQ(adjusted_rand_index(Labels{0, 0, 1, 1}, Labels{0, 1, 0, 1}), -0.5);
  // Contingency (2 1; 1 2): both 2, a 6, b 6, of 15: (2 - 12/5) / (6 - 12/5) = -1/9.
  EXPECT_DOUBLE_EQ(adjusted_rand_index(Labels{0, 0, 0, 1, 1, 1}, Labels{0, 0, 1, 0, 1, 1}), -1.0 / 9.0);
  // Contingency (3 1; 0 3), n = 7: both 6, a 9, b 9, of 21: (6 - 27/7) / (9 - 27/7) = 5/12.
  EXPECT_NEAR(adjusted_rand_index(Labels{0, 0, 0, 0, 1, 1, 1}, Labels{0, 0, 0, 1, 1, 1, 1}), 5.0 / 12.0,
              1e-15);
}

TEST(AdjustedRandIndex, IsOneForEqualPartitionsUnderAnyNames) {
  const Labels a{0, 0, 1, 1, 2, 2, 2};
  EXPECT_EQ(adjusted_rand_index(a, a), 1.0);
  EXPECT_EQ(adjusted_rand_index(a, Labels{7, 7, -1, -1, 0, 0, 0}), 1.0);
  EXPECT_EQ(adjusted_rand_index(Labels{0, 0, 0}, Labels{4, 4, 4}), 1.0);
  EXPECT_EQ(adjusted_rand_index(Labels{0, 1, 2}, Labels{2, 0, 1}), 1.0);
  EXPECT_EQ(adjusted_rand_index(Labels{3}, Labels{5}), 1.0);
}

TEST(AdjustedRandIndex, DoesNotDependOnNamesOrOrder) {
  const Labels a{0, 1, 0, 2, 1, 2, 0, 1};
  const Labels b{1, 1, 0, 0, 2, 2, 1, 0};
  Labels renamed = b;
  for (int& label : renamed) label = 10 - 3 * label;
  EXPECT_DOUBLE_EQ(adjusted_rand_index(a, b), adjusted_rand_index(a, renamed));
  EXPECT_DOUBLE_EQ(adjusted_rand_index(a, b), adjusted_rand_index(b, a));
}

TEST(AdjustedRandIndex, IsZeroForAPartitionThatSaysNothing) {
  EXPECT_EQ(adjusted_rand_index(Labels{0, 0, 0, 0, 0}, Labels{0, 0, 1, 1, 2}), 0.0);
  EXPECT_EQ(adjusted_rand_index(Labels{0, 1, 2, 3, 4}, Labels{0, 0, 1, 1, 2}), 0.0);
  std::mt19937 random(3);
  Labels a(20'000);
  Labels b(20'000);
  for (std::size_t i = 0; i < a.size(); ++i) {
    a[i] = static_cast<int>(random() % 5);
    b[i] = static_cast<int>(random() % 5);
  }
  EXPECT_NEAR(adjusted_rand_index(a, b), 0.0, 2e-3);
}

TEST(AdjustedRandIndex, RefusesUnequalOrEmptyInput) {
  EXPECT_THROW(adjusted_rand_index(Labels{0, 1}, Labels{0}), std::invalid_argument);
  EXPECT_THROW(adjusted_rand_index(Labels{}, Labels{}), std::invalid_argument);
}

// Five clouds of 60 points in 41 dimensions, far apart, shuffled.
struct Clouds {
  std::vector<float> points;
  Labels truth;
};
Clouds make_clouds(float spread) {
  std::mt19937 random(5);
  std::normal_distribution<float> normal;
  std::vector<float> centres(5 * 41);
  for (float& value : centres) value = 10 * normal(random);
  Clouds clouds;
  for (int i = 0; i < 300; ++i) {
    const int cloud = (i * 7) % 5;
    clouds.truth.push_back(cloud);
    for (int d = 0; d < 41; ++d) {
      clouds.points.push_back(centres[static_cast<std::size_t>(cloud * 41 + d)] + spread * normal(random));
    }
  }
  return clouds;
}

TEST(KMeans, FindsCloudsThatLieApart) {
  const Clouds clouds = make_clouds(1.0F);
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    EXPECT_EQ(adjusted_rand_index(k_means(clouds.points, 41, {.seed = seed}), clouds.truth), 1.0) << seed;
  }
}

TEST(KMeans, TheSameSeedGivesTheSameClusters) {
  const Clouds clouds = make_clouds(30.0F);  // overlapping, so that starts matter
  const KMeansOptions one_start{.seed = 1, .restarts = 1};
  EXPECT_EQ(k_means(clouds.points, 41, one_start), k_means(clouds.points, 41, one_start));
  std::set<Labels> results;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    results.insert(k_means(clouds.points, 41, {.seed = seed, .restarts = 1}));
  }
  EXPECT_GT(results.size(), 1U);
}

// One dimension, small enough to know the optimum: {0, 1}, {10, 11}, {100}.
TEST(KMeans, FindsTheOptimumOfAHandMadeSet) {
  const std::vector<float> points{0, 100, 10, 1, 11};
  const Labels labels = k_means(points, 1, {.clusters = 3});
  EXPECT_EQ(adjusted_rand_index(labels, Labels{0, 1, 2, 0, 2}), 1.0);
}

TEST(KMeans, EndsWithFewerDistinctPointsThanClusters) {
  const std::vector<float> points{1, 1, 1, 1, 2, 2};
  const Labels labels = k_means(points, 1, {.clusters = 4});
  EXPECT_EQ(adjusted_rand_index(labels, Labels{0, 0, 0, 0, 1, 1}), 1.0);
}

TEST(KMeans, RefusesBadInput) {
  const std::vector<float> points{0, 1, 2, 3};
  EXPECT_THROW(k_means(points, 3, {.clusters = 1}), std::invalid_argument);
  EXPECT_THROW(k_means(points, 0, {.clusters = 1}), std::invalid_argument);
  EXPECT_THROW(k_means(points, 2, {.clusters = 3}), std::invalid_argument);
  EXPECT_THROW(k_means(points, 2, {.clusters = 0}), std::invalid_argument);
  EXPECT_THROW(k_means(points, 2, {.clusters = 1, .restarts = 0}), std::invalid_argument);
  const std::vector<float> broken{0, std::numeric_limits<float>::quiet_NaN()};
  EXPECT_THROW(k_means(broken, 1, {.clusters = 1}), std::invalid_argument);
}

}  // namespace
}  // namespace q3d::filters
