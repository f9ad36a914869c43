#include "filters/keypoint_choice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <stdexcept>

namespace q3d::filters {
namespace {

// The first `visible` keypoints are visible, the others not.
smal::CropKeypoints keypoints(std::size_t visible) {
  smal::CropKeypoints annotated{};
  for (std::size_t k = 0; k < visible; ++k) annotated[k].weight = 0.5F;
  return annotated;
}

int count(const KeypointFlags& flags) {
  return static_cast<int>(std::count(flags.begin(), flags.end(), true));
}

TEST(ShuffledVisible, HoldsEachVisibleKeypointOnce) {
  const auto order = shuffled_visible(keypoints(9), 3, "a");
  EXPECT_EQ(std::set<std::size_t>(order.begin(), order.end()),
            (std::set<std::size_t>{0, 1, 2, 3, 4, 5, 6, 7, 8}));
  EXPECT_EQ(order.size(), 9U);
  EXPECT_EQ(order, shuffled_visible(keypoints(9), 3, "a"));
  EXPECT_NE(order, shuffled_visible(keypoints(9), 4, "a"));
  EXPECT_NE(order, shuffled_visible(keypoints(9), 3, "b"));
}

TEST(HeldOutKeypoints, AreTheShareOfTheVisibleOnes) {
  const auto held_out = [](std::size_t visible, double share) {
    const KeypointFlags flags = held_out_keypoints(keypoints(visible), share, 0, "a");
    for (std::size_t k = visible; k < flags.size(); ++k) EXPECT_FALSE(flags[k]) << "invisible";
    return count(flags);
  };
  EXPECT_EQ(held_out(20, 0.2), 4);
  EXPECT_EQ(held_out(10, 0.25), 3) << "2.5, halves up";
  EXPECT_EQ(held_out(4, 0.1), 1) << "at least one";
  EXPECT_EQ(held_out(4, 0.95), 3) << "not all";
  EXPECT_EQ(held_out(2, 0.5), 1);
  EXPECT_EQ(held_out(1, 0.5), 0);
  EXPECT_EQ(held_out(0, 0.5), 0);
  EXPECT_THROW(held_out(4, 0.0), std::invalid_argument);
  EXPECT_THROW(held_out(4, 1.0), std::invalid_argument);
}

TEST(HeldOutKeypoints, EveryKeypointHasItsTurn) {
  std::array<int, 26> times{};
  for (int sample = 0; sample < 1000; ++sample) {
    const auto flags = held_out_keypoints(keypoints(10), 0.2, 0, std::to_string(sample));
    for (std::size_t k = 0; k < flags.size(); ++k) times[k] += flags[k] ? 1 : 0;
  }
  // Binomial, mean 200, deviation 12.6: five deviations.
  for (std::size_t k = 0; k < 10; ++k) EXPECT_NEAR(times[k], 200, 63) << k;
}

}  // namespace
}  // namespace q3d::filters
