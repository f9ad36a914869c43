#include "filters/bootstrap.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>

namespace q3d::filters {
namespace {

std::vector<std::size_t> own_pictures(std::size_t items) {
  std::vector<std::size_t> pictures(items);
  std::iota(pictures.begin(), pictures.end(), std::size_t{0});
  return pictures;
}

// Mean 0.5 and standard deviation 1: half of the items one deviation above the mean, half below.
std::vector<double> two_valued(std::size_t items) {
  std::vector<double> differences(items);
  for (std::size_t i = 0; i < items; ++i) differences[i] = 0.5 + (i % 2 == 0 ? 1.0 : -1.0);
  return differences;
}

TEST(PairedBootstrap, EqualDifferencesLeaveNoDoubt) {
  const std::vector<double> differences(20, 0.25);
  const BootstrapInterval interval = paired_bootstrap(differences, own_pictures(20), {});
  EXPECT_DOUBLE_EQ(interval.mean, 0.25);
  EXPECT_DOUBLE_EQ(interval.low, 0.25);
  EXPECT_DOUBLE_EQ(interval.high, 0.25);
}

// Many items: the means of resamples are normal with deviation sigma / sqrt(n) (central limit theorem), so
// the 95 % interval is mean +- 1.96 sigma / sqrt(n).
TEST(PairedBootstrap, WidthIsThatOfTheCentralLimitTheorem) {
  constexpr std::size_t kItems = 400;
  const BootstrapInterval interval = paired_bootstrap(two_valued(kItems), own_pictures(kItems), {});
  const double half_width = 1.959964 / std::sqrt(400.0);
  EXPECT_DOUBLE_EQ(interval.mean, 0.5);
  EXPECT_NEAR(interval.low, 0.5 - half_width, 0.006);
  EXPECT_NEAR(interval.high, 0.5 + half_width, 0.006);
}

// Two pictures: the mean of a resample is their first, their mean or their second with chances 1/4, 1/2, 1/4,
// so an interval of 40 % has both ends at the mean, and one of 60 % at the two values.
TEST(PairedBootstrap, TwoPicturesGiveThreeMeans) {
  const std::vector<double> differences{1.0, 3.0};
  const BootstrapInterval inner = paired_bootstrap(differences, own_pictures(2), {10'000, 0.4, 1});
  EXPECT_DOUBLE_EQ(inner.low, 2.0);
  EXPECT_DOUBLE_EQ(inner.high, 2.0);
  const BootstrapInterval outer = paired_bootstrap(differences, own_pictures(2), {10'000, 0.6, 1});
  EXPECT_DOUBLE_EQ(outer.low, 1.0);
  EXPECT_DOUBLE_EQ(outer.high, 3.0);
}

// Animals of one picture are drawn together: 400 items in 100 pictures of four equal differences know no more
// than 100 items do.
TEST(PairedBootstrap, ItemsOfAPictureAreNotIndependent) {
  std::vector<double> differences;
  std::vector<std::size_t> pictures;
  for (std::size_t picture = 0; picture < 100; ++picture) {
    for (int animal = 0; animal < 4; ++animal) {
      differences.push_back(picture % 2 == 0 ? 1.5 : -0.5);
      pictures.push_back(picture);
    }
  }
  const BootstrapInterval interval = paired_bootstrap(differences, pictures, {});
  const double half_width = 1.959964 / std::sqrt(100.0);
  EXPECT_NEAR(interval.low, 0.5 - half_width, 0.015);
  EXPECT_NEAR(interval.high, 0.5 + half_width, 0.015);
}

// The mean of a resample is over the items drawn, so a picture with more animals weighs more.
TEST(PairedBootstrap, PicturesWeighByTheirItems) {
  const std::vector<double> differences{6.0, 0.0, 0.0};
  const std::vector<std::size_t> pictures{0, 1, 1};
  const BootstrapInterval interval = paired_bootstrap(differences, pictures, {10'000, 0.4, 3});
  EXPECT_DOUBLE_EQ(interval.mean, 2.0);
  EXPECT_DOUBLE_EQ(interval.low, 2.0);  // one of each picture: 6 / 3
  EXPECT_DOUBLE_EQ(interval.high, 2.0);
}

// Items that do not vary and two runs that do: all doubt is between the runs.
TEST(PairedBootstrap, RunsAreDrawnToo) {
  std::vector<double> differences(50, 1.0);
  differences.resize(100, 3.0);
  const BootstrapInterval interval = paired_bootstrap(differences, own_pictures(50), {10'000, 0.6, 5});
  EXPECT_DOUBLE_EQ(interval.mean, 2.0);
  EXPECT_DOUBLE_EQ(interval.low, 1.0);
  EXPECT_DOUBLE_EQ(interval.high, 3.0);
}

TEST(PairedBootstrap, SeedDecides) {
  const auto differences = two_valued(30);
  const auto pictures = own_pictures(30);
  const BootstrapInterval a = paired_bootstrap(differences, pictures, {500, 0.95, 7});
  const BootstrapInterval b = paired_bootstrap(differences, pictures, {500, 0.95, 7});
  const BootstrapInterval c = paired_bootstrap(differences, pictures, {500, 0.95, 8});
  EXPECT_EQ(a.low, b.low);
  EXPECT_EQ(a.high, b.high);
  EXPECT_TRUE(a.low != c.low || a.high != c.high);
}

TEST(PairedBootstrap, RefusesWhatHasNoMeaning) {
  const std::vector<double> two{1.0, 2.0};
  const std::vector<double> not_a_number{1.0, std::numeric_limits<double>::quiet_NaN()};
  EXPECT_THROW(paired_bootstrap({}, {}, {}), std::invalid_argument);
  EXPECT_THROW(paired_bootstrap(two, own_pictures(3), {}), std::invalid_argument);
  EXPECT_THROW(paired_bootstrap(not_a_number, own_pictures(2), {}), std::invalid_argument);
  EXPECT_THROW(paired_bootstrap(two, std::vector<std::size_t>{0, 2}, {}), std::invalid_argument);
  EXPECT_THROW(paired_bootstrap(two, own_pictures(2), {0, 0.95, 0}), std::invalid_argument);
  EXPECT_THROW(paired_bootstrap(two, own_pictures(2), {100, 1.0, 0}), std::invalid_argument);
}

constexpr double kOut = std::numeric_limits<double>::quiet_NaN();  // not in the set

TEST(BootstrapOfSets, OfEqualSetsIsThePairedOne) {
  const std::vector<double> differences = two_valued(60);
  std::vector<double> first(60), second(60);
  for (std::size_t i = 0; i < 60; ++i) {
    first[i] = 3.0 * static_cast<double>(i);
    second[i] = first[i] + differences[i];
  }
  const BootstrapInterval paired = paired_bootstrap(differences, own_pictures(60), {2'000, 0.95, 4});
  const BootstrapInterval of_sets = bootstrap_of_sets(first, second, own_pictures(60), {2'000, 0.95, 4});
  EXPECT_NEAR(of_sets.mean, paired.mean, 1e-10);
  EXPECT_NEAR(of_sets.low, paired.low, 1e-10);
  EXPECT_NEAR(of_sets.high, paired.high, 1e-10);
}

TEST(BootstrapOfSets, IsTheDifferenceOfTheMembersMeans) {
  const BootstrapInterval interval = bootstrap_of_sets(
      std::vector{1.0, kOut, 3.0, kOut}, std::vector{kOut, 5.0, 7.0, kOut}, own_pictures(4), {});
  EXPECT_DOUBLE_EQ(interval.mean, 4.0);
  // The mean over two runs is (1 + 2 + 6) / 3 against 10.
  const BootstrapInterval runs = bootstrap_of_sets(std::vector{1.0, 2.0, 6.0, kOut},
                                                   std::vector{kOut, 10.0, 10.0, 10.0}, own_pictures(2), {});
  EXPECT_DOUBLE_EQ(runs.mean, 7.0);
}

TEST(BootstrapOfSets, ConstantSetsLeaveNoDoubtThoughTheySometimesAreNotDrawn) {
  const BootstrapInterval interval =
      bootstrap_of_sets(std::vector{2.0, 2.0, kOut}, std::vector{kOut, kOut, 5.0}, own_pictures(3), {});
  EXPECT_DOUBLE_EQ(interval.low, 3.0);
  EXPECT_DOUBLE_EQ(interval.high, 3.0);
}

// Two sets of 200 that share no picture, each of deviation 1: their means' difference has the deviation
// sqrt(2 / 200) = 0.1.
TEST(BootstrapOfSets, WidthIsThatOfTwoMeans) {
  std::vector<double> first(400, kOut), second(400, kOut);
  for (std::size_t i = 0; i < 200; ++i) {
    first[i] = i % 2 == 0 ? 1.0 : -1.0;
    second[200 + i] = 0.5 + (i % 2 == 0 ? 1.0 : -1.0);
  }
  const BootstrapInterval interval = bootstrap_of_sets(first, second, own_pictures(400), {});
  EXPECT_DOUBLE_EQ(interval.mean, 0.5);
  EXPECT_NEAR(interval.low, 0.5 - 0.196, 0.012);
  EXPECT_NEAR(interval.high, 0.5 + 0.196, 0.012);
}

TEST(BootstrapOfSets, RefusesEmptySetsAndOtherSizes) {
  const std::vector<double> two{1.0, 2.0};
  const std::vector<double> none{kOut, kOut};
  const std::vector<double> infinite{1.0, std::numeric_limits<double>::infinity()};
  EXPECT_THROW(bootstrap_of_sets(two, none, own_pictures(2), {}), std::invalid_argument);
  EXPECT_THROW(bootstrap_of_sets(two, infinite, own_pictures(2), {}), std::invalid_argument);
  EXPECT_THROW(bootstrap_of_sets(two, std::vector<double>(4, 1.0), own_pictures(2), {}),
               std::invalid_argument);
}

}  // namespace
}  // namespace q3d::filters
