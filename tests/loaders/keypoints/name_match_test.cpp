#include "loaders/keypoints/name_match.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>

namespace q3d::loaders::keypoints {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const Topology& kingdom() {
  return topology("animal_kingdom23");
}

std::string refusal(const std::vector<std::string>& names) {
  try {
    match_names(kingdom(), names);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(MatchNames, follows_names_not_positions) {
  std::vector<std::string> names = kingdom().keypoints;
  std::reverse(names.begin(), names.end());
  names[0] += " ";  // the real files have "Ankle_Left "
  names[1] = "tail_mid_BACK";
  const NameMatch match = match_names(kingdom(), names);
  EXPECT_EQ(match.places.front(), 22);
  EXPECT_EQ(match.places.back(), 0);
  EXPECT_EQ(match.places[21], 1);
  EXPECT_THAT(match.unknown, IsEmpty());
  EXPECT_THAT(match.missing, IsEmpty());
}

TEST(MatchNames, lists_what_is_missing_and_what_is_unknown) {
  std::vector<std::string> names = kingdom().keypoints;
  names[3] = "left_wing";
  names.pop_back();
  const NameMatch match = match_names(kingdom(), names);
  EXPECT_THAT(match.missing, ElementsAre("Mouth_Front_Top", "Tail_End_Back"));
  EXPECT_THAT(match.unknown, ElementsAre("left_wing"));
  EXPECT_EQ(match.places[3], -1);
  EXPECT_EQ(match.places[4], 4);
  EXPECT_THAT(match.note(kingdom()), HasSubstr("get weight 0: 2 of 23 (Mouth_Front_Top, Tail_End_Back)"));
  EXPECT_THAT(match.note(kingdom()), HasSubstr("left out: 1 of 22 (left_wing)"));
  EXPECT_EQ(match_names(kingdom(), kingdom().keypoints).note(kingdom()), "");
}

// A file of few keypoints, and a topology of few, are both fine; names of which most are unknown are not.
TEST(MatchNames, asks_for_half_of_the_shorter_list) {
  EXPECT_EQ(refusal({"Eye_Left", "Eye_Right"}), "");
  EXPECT_EQ(refusal({"Eye_Left", "ear"}), "");
  EXPECT_THAT(refusal({"Eye_Left", "ear", "horn"}), HasSubstr("Eye_Left, ear, horn; only 1 are in"));
  EXPECT_THAT(refusal({"eye.left", "eye.right"}), HasSubstr("none is in the topology animal_kingdom23"));
  EXPECT_THAT(refusal({}), HasSubstr("none is"));
  std::vector<std::string> names = kingdom().keypoints;
  for (int i = 0; i < 100; ++i) names.push_back("extra" + std::to_string(i));
  EXPECT_EQ(refusal(names), "");
}

TEST(MatchNames, a_name_may_not_occur_twice) {
  std::vector<std::string> names = kingdom().keypoints;
  names[3] = names[2];
  EXPECT_THAT(refusal(names), HasSubstr("keypoint 3 is named \"Eye_Right\", which occurs twice"));
}

TEST(InTopologyOrder, a_missing_point_is_unlabelled) {
  const NameMatch match = match_names(kingdom(), std::vector<std::string>{"Eye_Right", "Eye_Left"});
  const std::vector<manifests::Keypoint> points = in_topology_order(
      match, std::vector<manifests::Keypoint>{{1.0, 2.0, 2.0F, 1.0F}, {3.0, 4.0, 2.0F, 1.0F}});
  ASSERT_EQ(points.size(), 23U);
  EXPECT_EQ(points[1].x_px, 3.0);
  EXPECT_EQ(points[2].x_px, 1.0);
  EXPECT_EQ(points[0].v, 0.0F);
  EXPECT_EQ(points[0].weight, 0.0F);
  EXPECT_EQ(points[22].weight, 0.0F);
}

}  // namespace
}  // namespace q3d::loaders::keypoints
