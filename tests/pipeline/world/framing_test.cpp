#include "pipeline/world/framing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace q3d::pipeline::world {
namespace {

std::vector<Eigen::Vector3f> box_of_corners(float x, float y, float z) {
  std::vector<Eigen::Vector3f> corners;
  for (const float sx : {-x, x}) {
    for (const float sy : {-y, y}) {
      for (const float sz : {-z, z}) corners.emplace_back(sx, sy, sz);
    }
  }
  return corners;
}

TEST(CameraOfBox, HasTheCropCamerasFocalAndFlooredCentre) {
  // 1000 px for 256: a side of 128 gives 500. (2 * 11 + 128) // 2 = 75, (2 * 20 + 41) // 2 = 40.
  const PictureCamera camera = camera_of_box({11, 20, 128, 41});
  EXPECT_DOUBLE_EQ(camera.focal_px, 500.0);
  EXPECT_DOUBLE_EQ(camera.centre_x_px, 75.0);
  EXPECT_DOUBLE_EQ(camera.centre_y_px, 40.0);
  EXPECT_THROW(camera_of_box({5, 5, 0, 10}), std::invalid_argument);
}

TEST(FitTranslation, PutsTheBoundingBoxWhereItIsWanted) {
  const auto corners = box_of_corners(1.0F, 0.5F, 0.7F);
  const PictureCamera camera = camera_of_box({40, 60, 200, 100});
  const Eigen::Vector3f translation = fit_translation(corners, camera, {150.0, 90.0}, 180.0);
  double left = 1e9, right = -1e9, top = 1e9, bottom = -1e9;
  for (const Eigen::Vector3f& corner : corners) {
    const Eigen::Vector2d p = camera.project(corner + translation);
    left = std::min(left, p.x());
    right = std::max(right, p.x());
    top = std::min(top, p.y());
    bottom = std::max(bottom, p.y());
  }
  EXPECT_NEAR(0.5 * (left + right), 150.0, 0.01);
  EXPECT_NEAR(0.5 * (top + bottom), 90.0, 0.01);
  EXPECT_NEAR(std::max(right - left, bottom - top), 180.0, 0.01);
}

TEST(FrameAnimal, ABoxWithoutErrorIsTheSilhouettesBoundingBox) {
  const auto corners = box_of_corners(0.9F, 0.6F, 0.3F);
  const FramingHabits exact{
      .fill_low = 0.5, .fill_high = 0.9, .truncated = 0.0, .box_bias = 1.0, .box_spread = 0.0};
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    manifests::Rng rng(seed);
    const Framing framing = frame_animal(corners, {320, 240}, exact, rng);
    double left = 1e9, right = -1e9, top = 1e9, bottom = -1e9;
    for (const Eigen::Vector3f& corner : corners) {
      const Eigen::Vector2d p = framing.camera.project(corner + framing.translation);
      left = std::min(left, p.x());
      right = std::max(right, p.x());
      top = std::min(top, p.y());
      bottom = std::max(bottom, p.y());
    }
    EXPECT_NEAR(framing.box.x, left, 1.5);
    EXPECT_NEAR(framing.box.y, top, 1.5);
    EXPECT_NEAR(framing.box.x + framing.box.width, right, 1.5);
    EXPECT_NEAR(framing.box.y + framing.box.height, bottom, 1.5);
  }
}

TEST(FrameAnimal, ATruncatedAnimalsBoxStaysInsideThePicture) {
  const auto corners = box_of_corners(0.9F, 0.6F, 0.3F);
  const FramingHabits cut{
      .fill_low = 0.8, .fill_high = 1.1, .truncated = 1.0, .box_bias = 1.03, .box_spread = 0.03};
  int at_border = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    manifests::Rng rng(seed);
    const cv::Rect box = frame_animal(corners, {320, 240}, cut, rng).box;
    EXPECT_EQ(box & cv::Rect(0, 0, 320, 240), box);
    EXPECT_GT(box.area(), 0);
    at_border += box.x == 0 || box.y == 0 || box.br().x == 320 || box.br().y == 240 ? 1 : 0;
  }
  EXPECT_GE(at_border, 36);
}

}  // namespace
}  // namespace q3d::pipeline::world
