#include "loaders/keypoints/topology.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

namespace q3d::loaders::keypoints {
namespace {

using ::testing::HasSubstr;

int index_of(const Topology& topology, const std::string& name) {
  const auto found = std::find(topology.keypoints.begin(), topology.keypoints.end(), name);
  EXPECT_NE(found, topology.keypoints.end()) << topology.name << " " << name;
  return static_cast<int>(found - topology.keypoints.begin());
}

TEST(Topology, has_the_published_sizes) {
  const std::vector<std::pair<std::string, std::size_t>> expected{
      {"animal3d26", 26}, {"superanimal_quadruped39", 39}, {"animal_kingdom23", 23}};
  ASSERT_EQ(topologies().size(), expected.size());
  for (const auto& [name, size] : expected) EXPECT_EQ(topology(name).keypoints.size(), size) << name;
}

TEST(Topology, mirror_images_come_in_pairs_of_left_and_right) {
  for (const Topology& each : topologies()) {
    ASSERT_EQ(each.flip.size(), each.keypoints.size());
    for (std::size_t i = 0; i < each.flip.size(); ++i) {
      const auto mirror = static_cast<std::size_t>(each.flip[i]);
      EXPECT_EQ(each.flip[mirror], static_cast<int>(i)) << each.name << " " << each.keypoints[i];
    }
  }
}

TEST(Topology, maps_keep_left_left) {
  // Mirroring before the map or after it must give the same 26.
  const Topology& animal3d = topology("animal3d26");
  for (const Topology& each : topologies()) {
    for (std::size_t i = 0; i < each.source.size(); ++i) {
      const int here = each.source[i];
      const int mirrored = each.source[static_cast<std::size_t>(animal3d.flip[i])];
      ASSERT_EQ(here < 0, mirrored < 0) << each.name << " " << animal3d.keypoints[i];
      if (here < 0) continue;
      EXPECT_EQ(each.flip[static_cast<std::size_t>(here)], mirrored) << each.name << " " << i;
    }
  }
}

TEST(Topology, animal3d_flip_is_the_measured_one) {
  EXPECT_EQ(topology("animal3d26").flip,
            (std::vector<int>{1,  0,  2,  4,  3,  6,  5,  7,  9,  8,  11, 10, 13,
                              12, 15, 14, 17, 16, 18, 19, 21, 20, 23, 22, 24, 25}));
}

// The map that the official code and FMPose3D publish as numbers.
TEST(Topology, superanimal_map_is_the_official_one) {
  EXPECT_EQ(topology("superanimal_quadruped39").source,
            (std::array<int, 26>{10, 5,  -1, 26, 29, 30, 35, 22, 24, 27, 31, 32, -1,
                                 -1, 25, 28, 33, 34, 15, 23, 11, 6,  4,  3,  0,  -1}));
}

TEST(Topology, animal_kingdom_wrists_are_paws_and_hips_have_no_counterpart) {
  const Topology& kingdom = topology("animal_kingdom23");
  const Topology& animal3d = topology("animal3d26");
  const auto source_of = [&](const char* name) {
    return kingdom.source[static_cast<std::size_t>(index_of(animal3d, name))];
  };
  EXPECT_EQ(source_of("left_front_paw"), index_of(kingdom, "Wrist_Left"));
  EXPECT_EQ(source_of("right_back_knee"), index_of(kingdom, "Knee_Right"));
  EXPECT_EQ(source_of("tail_tip"), index_of(kingdom, "Tail_End_Back"));
  EXPECT_EQ(source_of("left_back_thigh"), -1);
}

TEST(Topology, unknown_name_lists_the_known) {
  try {
    topology("coco17");
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("coco17"));
    EXPECT_THAT(error.what(), HasSubstr("animal_kingdom23"));
  }
}

TEST(ToAnimal3d, carries_points_and_leaves_the_rest_unlabelled) {
  std::vector<manifests::Keypoint> points(39);
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = {1.0 * i, 2.0 * i, 2.0F, 1.0F};
  const manifests::Keypoints mapped = to_animal3d(topology("superanimal_quadruped39"), points);
  EXPECT_EQ(mapped[0].x_px, 10.0);  // left_eye
  EXPECT_EQ(mapped[6].y_px, 70.0);  // right_back_paw is 35
  EXPECT_EQ(mapped[6].v, 2.0F);
  EXPECT_EQ(mapped[12].weight, 0.0F);  // left_shoulder has no source
  points.pop_back();
  EXPECT_THROW(to_animal3d(topology("superanimal_quadruped39"), points), std::invalid_argument);
}

}  // namespace
}  // namespace q3d::loaders::keypoints
