#include "pipeline/world/annotator.h"

#include <gtest/gtest.h>

#include <cmath>

namespace q3d::pipeline::world {
namespace {

constexpr int kAnimals = 4000;

std::vector<Landmark> two_paws_and_a_nose() {
  return {{.name = "left_front_paw", .keypoint = 3, .mirror = 1},
          {.name = "right_front_paw", .keypoint = 4, .mirror = 0},
          {.name = "nose", .keypoint = 24, .mirror = 2}};
}

std::vector<SeenLandmark> in_the_open() {
  return {{.px = {10.0, 20.0}, .exists = true, .inside = true},
          {.px = {50.0, 20.0}, .exists = true, .inside = true},
          {.px = {30.0, 5.0}, .exists = true, .inside = true}};
}

TEST(Annotate, LabelsAtTheRateOfWhatCanBeSeen) {
  const LabelHabits habits{
      .visible = 0.9, .self_hidden = 0.5, .occluded = 0.2, .swapped = 0.0, .jitter = 0.0};
  auto seen = in_the_open();
  seen[1].self_hidden = true;
  seen[2].occluded = true;
  manifests::Rng rng(1);
  std::array<int, 3> given{};
  for (int i = 0; i < kAnimals; ++i) {
    const auto labels = annotate(two_paws_and_a_nose(), seen, 100.0, habits, rng);
    for (std::size_t k = 0; k < 3; ++k) given[k] += labels[k].given ? 1 : 0;
  }
  EXPECT_NEAR(given[0], 0.9 * kAnimals, 4 * std::sqrt(0.9 * 0.1 * kAnimals));
  EXPECT_NEAR(given[1], 0.5 * kAnimals, 4 * std::sqrt(0.5 * 0.5 * kAnimals));
  EXPECT_NEAR(given[2], 0.2 * kAnimals, 4 * std::sqrt(0.2 * 0.8 * kAnimals));
}

TEST(Annotate, NeverLabelsWhatIsOutsideOrDoesNotExist) {
  auto seen = in_the_open();
  seen[0].inside = false;
  seen[2].exists = false;
  manifests::Rng rng(2);
  for (int i = 0; i < 200; ++i) {
    const auto labels = annotate(two_paws_and_a_nose(), seen, 100.0, {.visible = 1.0, .swapped = 0.0}, rng);
    EXPECT_FALSE(labels[0].given);
    EXPECT_TRUE(labels[1].given);
    EXPECT_FALSE(labels[2].given);
  }
}

TEST(Annotate, JitterHasTheStatedDeviation) {
  const LabelHabits habits{.visible = 1.0, .swapped = 0.0, .jitter = 0.01, .vague_factor = 3.0};
  auto landmarks = two_paws_and_a_nose();
  landmarks[2].vague = true;
  manifests::Rng rng(3);
  double clear = 0.0, vague = 0.0;
  for (int i = 0; i < kAnimals; ++i) {
    const auto labels = annotate(landmarks, in_the_open(), 200.0, habits, rng);
    clear += std::pow(labels[0].x_px - 10.0, 2);
    vague += std::pow(labels[2].y_px - 5.0, 2);
  }
  EXPECT_NEAR(std::sqrt(clear / kAnimals), 2.0, 0.1);
  EXPECT_NEAR(std::sqrt(vague / kAnimals), 6.0, 0.3);
}

TEST(Annotate, SwapsExchangeTheTwoSidesAtTheStatedRate) {
  const LabelHabits habits{.visible = 1.0, .swapped = 0.2, .jitter = 0.0};
  manifests::Rng rng(4);
  int swapped = 0;
  for (int i = 0; i < kAnimals; ++i) {
    const auto labels = annotate(two_paws_and_a_nose(), in_the_open(), 100.0, habits, rng);
    EXPECT_EQ(labels[2].x_px, 30.0);
    EXPECT_EQ(labels[0].x_px + labels[1].x_px, 60.0);
    swapped += labels[0].x_px == 50.0 ? 1 : 0;
  }
  // Two of the four kinds of swap (fore legs, everything) exchange fore paws.
  EXPECT_NEAR(swapped, 0.1 * kAnimals, 4 * std::sqrt(0.1 * 0.9 * kAnimals));
}

}  // namespace
}  // namespace q3d::pipeline::world
