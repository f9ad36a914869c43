#include "pipeline/render/silhouette.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

namespace q3d::pipeline::render {
namespace {

using Faces = std::vector<std::array<std::int32_t, 3>>;

std::int64_t area(const std::vector<std::uint8_t>& mask) {
  return std::accumulate(mask.begin(), mask.end(), std::int64_t{0}) / 255;
}

TEST(FillTriangles, FillsCentresInsideAndOnTheEdge) {
  // The right angle at (1, 1), legs of 3: rows of 4, 3, 2 and 1 pixels.
  const std::vector<float> points{1, 1, 4, 1, 1, 4};
  for (const Faces& faces : {Faces{{0, 1, 2}}, Faces{{0, 2, 1}}}) {
    const auto mask = fill_triangles(points, faces, 6);
    for (int y = 0; y < 6; ++y) {
      for (int x = 0; x < 6; ++x) {
        const bool inside = x >= 1 && y >= 1 && x + y <= 5;
        EXPECT_EQ(mask[static_cast<std::size_t>(6 * y + x)], inside ? 255 : 0) << x << " " << y;
      }
    }
  }
}

TEST(FillTriangles, CutsAtTheBorderAndUnites) {
  const std::vector<float> points{-10, -10, 30, -10, -10, 30, 2.25F, 2.25F, 2.75F, 2.25F, 2.5F, 2.75F};
  EXPECT_EQ(area(fill_triangles(points, Faces{{0, 1, 2}}, 8)), 64);
  EXPECT_EQ(area(fill_triangles(points, Faces{{3, 4, 5}}, 8)), 0) << "between the centres";
  EXPECT_EQ(area(fill_triangles(points, Faces{{0, 1, 2}, {3, 4, 5}}, 8)), 64);
}

TEST(FillTriangles, LeavesOutWhatIsNotFinite) {
  const std::vector<float> points{0, 0, 4, 0, std::numeric_limits<float>::quiet_NaN(), 4};
  EXPECT_EQ(area(fill_triangles(points, Faces{{0, 1, 2}}, 8)), 0);
  EXPECT_THROW(fill_triangles(points, Faces{{0, 1, 3}}, 8), std::out_of_range);
  EXPECT_THROW(fill_triangles(points, Faces{{0, 1, -1}}, 8), std::out_of_range);
}

TEST(CropSilhouette, ProjectsLikeTheCropsCamera) {
  // A square of side 0.2 at depth 10: 1000 / 10 * 0.2 = 20 px, the middle at px 128 + 1000 / 10 * 0.1 = 138.
  const std::vector<float> vertices{-0.1F, -0.1F, 0, 0.1F, -0.1F, 0, 0.1F, 0.1F, 0, -0.1F, 0.1F, 0};
  const auto mask = crop_silhouette(vertices, {0.1F, 0.0F, 10.0F}, Faces{{0, 1, 2}, {0, 2, 3}});
  ASSERT_EQ(mask.size(), 256U * 256U);
  const auto is_inside = [&](std::size_t x, std::size_t y) { return mask[256 * y + x] == 255; };
  EXPECT_TRUE(is_inside(129, 119) && is_inside(147, 137) && is_inside(138, 128));
  EXPECT_FALSE(is_inside(127, 128) || is_inside(149, 128) || is_inside(138, 117) || is_inside(138, 139));
  EXPECT_NEAR(static_cast<double>(area(mask)), 20.0 * 20.0, 2 * 20 + 1);
}

TEST(CropSilhouette, LeavesOutWhatLiesBehindTheCamera) {
  const std::vector<float> vertices{-0.1F, -0.1F, 0, 0.1F, -0.1F, 0, 0.1F, 0.1F, -11.0F};
  EXPECT_EQ(area(crop_silhouette(vertices, {0, 0, 10.0F}, Faces{{0, 1, 2}})), 0);
}

}  // namespace
}  // namespace q3d::pipeline::render
