#include "pipeline/report/mesh_painter.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "pipeline/render/silhouette.h"

namespace q3d::pipeline::report {
namespace {

using Faces = std::vector<std::array<std::int32_t, 3>>;

constexpr int kSide = 256;

cv::Mat grey_tile() {
  return {kSide, kSide, CV_8UC3, cv::Scalar(100, 100, 100)};
}

// A rectangle that faces the camera.
Vertices plate(float left, float top, float right, float bottom, float depth) {
  return {{left, top, depth}, {right, top, depth}, {right, bottom, depth}, {left, bottom, depth}};
}
const Faces kPlate{{0, 2, 1}, {0, 3, 2}};

TEST(CropCamera, SeesTheCropOfTheNetwork) {
  const TileCamera whole = crop_camera(256, 1.0);
  EXPECT_DOUBLE_EQ(whole.focal_px, 1000.0);
  EXPECT_DOUBLE_EQ(whole.centre_px, 128.0);
  const TileCamera wider = crop_camera(300, 1.2);
  EXPECT_DOUBLE_EQ(wider.focal_px, 1000.0 / 256.0 * 250.0) << "the crop itself has 250 px";
  EXPECT_DOUBLE_EQ(wider.centre_px, 150.0);
}

TEST(MeshPainter, CoversThePixelsThatTheMeshProjectsTo) {
  // At depth 10 a length of 0.01 is one pixel: x from 128 - 30 to 128 + 50, y from 128 - 20 to 128 + 10.
  const MeshPainter painter(kPlate);
  cv::Mat tile = grey_tile();
  const cv::Mat coverage = painter.paint(tile, plate(-0.3F, -0.2F, 0.5F, 0.1F, 10.0F),
                                         crop_camera(kSide, 1.0), cv::Scalar(200, 0, 0), 1.0);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const bool on_edge = x == 98 || x == 178 || y == 108 || y == 138;
      if (on_edge) continue;  // half covered
      const bool inside = x > 98 && x < 178 && y > 108 && y < 138;
      ASSERT_EQ(coverage.at<std::uint8_t>(y, x), inside ? 255 : 0) << x << ", " << y;
      const cv::Vec3b pixel = tile.at<cv::Vec3b>(y, x);
      ASSERT_EQ(pixel == cv::Vec3b(100, 100, 100), !inside) << x << ", " << y;
    }
  }
  EXPECT_NEAR(coverage.at<std::uint8_t>(120, 98), 128, 1) << "the edge is smooth";
}

// The rasteriser of the guards is another implementation of the same camera.
TEST(MeshPainter, AgreesWithTheSilhouetteOfTheCrop) {
  const Faces faces{{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};
  const std::array<float, 3> translation{0.2F, -0.1F, 8.0F};
  const std::vector<float> flat{-0.6F, 0.5F, 0.2F, 0.7F, 0.3F, -0.4F, 0.1F, -0.7F, 0.0F, -0.2F, 0.1F, 0.9F};
  Vertices vertices;
  for (std::size_t v = 0; v < flat.size(); v += 3) {
    vertices.emplace_back(flat[v] + translation[0], flat[v + 1] + translation[1],
                          flat[v + 2] + translation[2]);
  }
  cv::Mat tile = grey_tile();
  const cv::Mat coverage =
      MeshPainter(faces).paint(tile, vertices, crop_camera(kSide, 1.0), cv::Scalar(200, 0, 0), 1.0);
  const std::vector<std::uint8_t> expected = render::crop_silhouette(flat, translation, faces);
  int both = 0, either = 0;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const bool drawn = coverage.at<std::uint8_t>(y, x) > 127;
      const bool filled = expected[static_cast<std::size_t>(y * kSide + x)] > 0;
      both += drawn && filled;
      either += drawn || filled;
    }
  }
  ASSERT_GT(either, 5000);
  EXPECT_GT(static_cast<double>(both) / either, 0.99);
}

TEST(MeshPainter, DrawsTheNearerSurfaceAndLightsIt) {
  // A plate that faces the camera, and behind it one that is seen at an angle from below.
  const Faces faces{{0, 2, 1}, {0, 3, 2}, {4, 6, 5}, {4, 7, 6}};
  Vertices vertices = plate(-0.5F, -0.5F, 0.0F, 0.5F, 10.0F);
  vertices.insert(vertices.end(),
                  {{-0.5F, -0.5F, 13.0F}, {0.6F, -0.5F, 13.0F}, {0.6F, 0.5F, 11.0F}, {-0.5F, 0.5F, 11.0F}});
  cv::Mat tile = grey_tile();
  MeshPainter(faces).paint(tile, vertices, crop_camera(kSide, 1.0), cv::Scalar(200, 200, 200), 1.0);
  const int facing = tile.at<cv::Vec3b>(128, 100)[0], turned = tile.at<cv::Vec3b>(128, 160)[0];
  EXPECT_NE(facing, 100);
  EXPECT_NE(turned, 100);
  EXPECT_NE(facing, turned) << "light depends on the surface's direction";
}

TEST(MeshPainter, OpacityLetsThePhotoShine) {
  const MeshPainter painter(kPlate);
  const Vertices vertices = plate(-1.0F, -1.0F, 1.0F, 1.0F, 10.0F);
  cv::Mat opaque = grey_tile(), half = grey_tile();
  painter.paint(opaque, vertices, crop_camera(kSide, 1.0), cv::Scalar(200, 200, 200), 1.0);
  painter.paint(half, vertices, crop_camera(kSide, 1.0), cv::Scalar(200, 200, 200), 0.5);
  EXPECT_NEAR(half.at<cv::Vec3b>(128, 128)[0], (100 + opaque.at<cv::Vec3b>(128, 128)[0]) / 2, 1);
}

TEST(MeshPainter, ABodyBehindTheCameraDrawsNothing) {
  cv::Mat tile = grey_tile();
  const cv::Mat coverage = MeshPainter(kPlate).paint(tile, plate(-1.0F, -1.0F, 1.0F, 1.0F, -10.0F),
                                                     crop_camera(kSide, 1.0), cv::Scalar(200, 0, 0), 1.0);
  EXPECT_EQ(cv::countNonZero(coverage), 0);
}

TEST(MeshPainter, RefusesTooFewVertices) {
  cv::Mat tile = grey_tile();
  EXPECT_THROW(MeshPainter(kPlate).paint(tile, {{0.0F, 0.0F, 1.0F}}, crop_camera(kSide, 1.0), {}, 1.0),
               std::invalid_argument);
}

TEST(SideView, TurnsTheBodyAndFillsTheTile) {
  // A bar that points away from the camera and is seen end on: 2 long, 0.2 wide and high.
  Vertices bar;
  for (const float x : {-0.1F, 0.1F}) {
    for (const float y : {-0.1F, 0.1F}) {
      for (const float z : {9.0F, 11.0F}) bar.emplace_back(x, y, z);
    }
  }
  const TileCamera camera = crop_camera(kSide, 1.2);
  double left = kSide, right = 0, near_end = 0, far_end = 0;
  const Vertices turned = side_view(bar, camera, kSide);
  for (std::size_t v = 0; v < bar.size(); ++v) {
    const double x = camera.centre_px + camera.focal_px * turned[v].x() / turned[v].z();
    left = std::min(left, x);
    right = std::max(right, x);
    (bar[v].z() < 10.0F ? near_end : far_end) = x;
    EXPECT_NEAR(turned[v].y(), bar[v].y(), 1e-5) << "up stays up";
  }
  EXPECT_NEAR(right - left, 0.84 * kSide, 4.0);
  EXPECT_GT(near_end, far_end) << "seen from the left of the photo, what was near lies to the right";
}

}  // namespace
}  // namespace q3d::pipeline::report
