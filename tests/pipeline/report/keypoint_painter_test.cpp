#include "pipeline/report/keypoint_painter.h"

#include <gtest/gtest.h>

#include <set>

#include "loaders/keypoints/topology.h"
#include "pipeline/report/lettering.h"

namespace q3d::pipeline::report {
namespace {

constexpr int kSide = 240;

const loaders::keypoints::Topology& animal3d() {
  return loaders::keypoints::topology("animal3d26");
}

cv::Vec3b rgb(const cv::Scalar& colour) {
  return {cv::saturate_cast<std::uint8_t>(colour[0]), cv::saturate_cast<std::uint8_t>(colour[1]),
          cv::saturate_cast<std::uint8_t>(colour[2])};
}

TEST(Bones, JoinKeypointsOfTheirOwnSide) {
  std::set<int> joined;
  for (const Bone& bone : bones()) {
    for (const int end : {bone.from, bone.to}) {
      const std::string& name = animal3d().keypoints.at(static_cast<std::size_t>(end));
      joined.insert(end);
      EXPECT_TRUE(bone.side == Side::right || !name.starts_with("right_")) << name;
      EXPECT_TRUE(bone.side == Side::left || !name.starts_with("left_")) << name;
    }
  }
  EXPECT_EQ(joined.size(), animal3d().keypoints.size()) << "every keypoint has a bone";
}

TEST(Bones, TheRightSideMirrorsTheLeft) {
  const auto key = [](int a, int b) { return std::pair(std::min(a, b), std::max(a, b)); };
  std::set<std::pair<int, int>> right, mirrored;
  for (const Bone& bone : bones()) {
    if (bone.side == Side::right) right.insert(key(bone.from, bone.to));
    if (bone.side == Side::left) {
      mirrored.insert(key(animal3d().flip[static_cast<std::size_t>(bone.from)],
                          animal3d().flip[static_cast<std::size_t>(bone.to)]));
    }
  }
  EXPECT_EQ(right, mirrored);
}

TEST(DrawKeypoints, PutsDiscsWhereTheCropSaysAndSkipsTheInvisible) {
  smal::CropKeypoints annotated{};
  annotated[3] = {-0.25F, 0.1F, 1.0F};   // left_front_paw
  annotated[4] = {0.25F, 0.1F, 0.5F};    // right_front_paw
  annotated[24] = {0.0F, -0.25F, 1.0F};  // nose
  annotated[2] = {0.4F, 0.4F, 0.0F};     // chin, not annotated
  cv::Mat tile(kSide, kSide, CV_8UC3, cv::Scalar(100, 100, 100));
  draw_keypoints(tile, annotated, nullptr, 1.2, 0);
  // 1.2 crops in 240 px: 200 px a crop, from the middle at 120.
  EXPECT_EQ(tile.at<cv::Vec3b>(140, 70), rgb(colours::kBlue));
  EXPECT_EQ(tile.at<cv::Vec3b>(140, 170), rgb(colours::kOrange));
  EXPECT_EQ(tile.at<cv::Vec3b>(70, 120), rgb(colours::kWhite));
  EXPECT_EQ(tile.at<cv::Vec3b>(200, 200), cv::Vec3b(100, 100, 100));
}

TEST(DrawKeypoints, JoinsEachKeypointWithItsProjection) {
  smal::CropKeypoints annotated{};
  annotated[24] = {-0.2F, 0.0F, 1.0F};
  constexpr float kNowhere = std::numeric_limits<float>::quiet_NaN();
  smal::CropPoints projected{};
  projected.fill({kNowhere, kNowhere});
  projected[24] = {0.2F, 0.0F};
  cv::Mat tile(kSide, kSide, CV_8UC3, cv::Scalar(100, 100, 100));
  draw_keypoints(tile, annotated, &projected, 1.2, 0);
  for (const int x : {100, 120, 140, 160}) {
    // The edges of a line are smooth, so its middle is nearly but not wholly of its colour.
    EXPECT_LT(cv::norm(tile.at<cv::Vec3b>(120, x), rgb(colours::kYellow), cv::NORM_INF), 25.0) << x;
  }
}

}  // namespace
}  // namespace q3d::pipeline::report
