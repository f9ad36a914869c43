#include "pipeline/evaluation/setting.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "pipeline/run/errors.h"

namespace q3d::pipeline::evaluation {
namespace {

std::vector<std::string> names(const Plan& plan) {
  std::vector<std::string> result;
  for (const Setting& setting : plan.settings) result.push_back(setting.name);
  return result;
}

TEST(PlanSettings, ThePredictionAloneNeedsNoPass) {
  const Plan plan = plan_settings({});
  EXPECT_EQ(names(plan), std::vector<std::string>{"prediction"});
  EXPECT_FALSE(plan.settings[0].uses_test_keypoints);
  EXPECT_TRUE(plan.passes.empty());
}

TEST(PlanSettings, SharesAndCurveFollowTheFullAdaptation) {
  const Plan plan =
      plan_settings({.tta_iterations = 30, .curve = {70, 0, 35}, .visible_shares = {0.3, 1.0, 0.5, 0.3}});
  const std::vector<std::string> expected{"prediction",
                                          "TTA 30",
                                          "TTA 30 with 50 % of the keypoints",
                                          "TTA 30 with 30 % of the keypoints",
                                          "iterate 0",
                                          "iterate 35",
                                          "iterate 70"};
  EXPECT_EQ(names(plan), expected);
  ASSERT_EQ(plan.passes.size(), 4U);
  EXPECT_EQ(plan.passes[3].iterations, 70);
  EXPECT_EQ(plan.passes[3].iterates, (std::vector<int>{0, 35, 70}));
  std::size_t given = 1;
  for (const TtaPass& pass : plan.passes) given += std::max<std::size_t>(1, pass.iterates.size());
  EXPECT_EQ(given, plan.settings.size());
  EXPECT_TRUE(plan.settings[1].uses_test_keypoints);
  EXPECT_FALSE(plan.settings[4].uses_test_keypoints) << "no step has been taken at iterate 0";
}

TEST(PlanSettings, RefusesWhatHasNoMeaning) {
  EXPECT_THROW(plan_settings({.tta_iterations = -1}), run::ConfigError);
  EXPECT_THROW(plan_settings({.curve = {-1}}), run::ConfigError);
  EXPECT_THROW(plan_settings({.tta_iterations = 10, .visible_shares = {0.0}}), run::ConfigError);
  EXPECT_THROW(plan_settings({.tta_iterations = 10, .visible_shares = {1.5}}), run::ConfigError);
  EXPECT_THROW(plan_settings({.visible_shares = {0.5}}), run::ConfigError);
}

device::CropKeypoints with_visible(std::size_t count) {
  device::CropKeypoints keypoints{};
  for (std::size_t k = 0; k < count; ++k) keypoints[k].weight = 1.0F;
  return keypoints;
}

std::vector<std::size_t> visible(const device::CropKeypoints& keypoints) {
  std::vector<std::size_t> result;
  for (std::size_t k = 0; k < keypoints.size(); ++k) {
    if (keypoints[k].is_visible()) result.push_back(k);
  }
  return result;
}

// The paper's case: of 22 keypoints, 70, 50 and 30 % are 16, 11 and 7.
TEST(HideKeypoints, RoundsUpAsThePaperDoes) {
  const device::CropKeypoints all = with_visible(22);
  EXPECT_EQ(hide_keypoints(all, 1.0, 0, "a"), all);
  EXPECT_EQ(visible(hide_keypoints(all, 0.7, 0, "a")).size(), 16U);
  EXPECT_EQ(visible(hide_keypoints(all, 0.5, 0, "a")).size(), 11U);
  EXPECT_EQ(visible(hide_keypoints(all, 0.3, 0, "a")).size(), 7U);
  EXPECT_EQ(visible(hide_keypoints(with_visible(10), 0.7, 0, "a")).size(), 7U);
  EXPECT_EQ(visible(hide_keypoints(with_visible(1), 0.1, 0, "a")).size(), 1U);
  EXPECT_TRUE(visible(hide_keypoints(with_visible(0), 0.5, 0, "a")).empty());
}

TEST(HideKeypoints, ASmallerShareIsPartOfALargerOne) {
  for (const char* id : {"a", "b", "c", "d"}) {
    const auto many = visible(hide_keypoints(with_visible(22), 0.7, 3, id));
    const auto few = visible(hide_keypoints(with_visible(22), 0.3, 3, id));
    EXPECT_TRUE(std::includes(many.begin(), many.end(), few.begin(), few.end()));
  }
}

TEST(HideKeypoints, SeedAndSampleDecide) {
  const device::CropKeypoints all = with_visible(22);
  const auto chosen = visible(hide_keypoints(all, 0.5, 3, "a"));
  EXPECT_EQ(chosen, visible(hide_keypoints(all, 0.5, 3, "a")));
  EXPECT_NE(chosen, visible(hide_keypoints(all, 0.5, 4, "a")));
  EXPECT_NE(chosen, visible(hide_keypoints(all, 0.5, 3, "b")));
}

// Every keypoint is hidden in about half of many samples.
TEST(HideKeypoints, NoKeypointIsPreferred) {
  std::vector<int> shown(22, 0);
  for (int sample = 0; sample < 400; ++sample) {
    for (const std::size_t k : visible(hide_keypoints(with_visible(22), 0.5, 0, std::to_string(sample))))
      ++shown[k];
  }
  for (const int count : shown) EXPECT_NEAR(count, 200, 50);  // five standard deviations
}

}  // namespace
}  // namespace q3d::pipeline::evaluation
