#include "pipeline/render/rays.h"

#include <gtest/gtest.h>

#include <vector>

namespace q3d::pipeline::render {
namespace {

// Two squares of side 2 before the origin, at z = 4 (triangles 0, 1) and at z = 9 (2, 3).
class TwoSquares : public ::testing::Test {
 protected:
  static std::vector<Eigen::Vector3f> corners() {
    std::vector<Eigen::Vector3f> result;
    for (const float z : {4.0F, 9.0F}) {
      for (const auto& [x, y] : {std::pair{-1.0F, -1.0F}, {1.0F, -1.0F}, {1.0F, 1.0F}, {-1.0F, 1.0F}}) {
        result.emplace_back(x, y, z);
      }
    }
    return result;
  }
  const std::vector<Eigen::Vector3f> corners_ = corners();
  const std::vector<Triangle> triangles_{{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
  const RayDevice device_;
  const RayMesh mesh_{device_, corners_, triangles_};
};

TEST_F(TwoSquares, NearestFindsTheFrontSquareAndItsBarycentricPlace) {
  // More rays than one packet holds, and not a multiple of it.
  std::vector<Eigen::Vector3f> rays(19, Eigen::Vector3f(5.0F, 0.0F, 1.0F));
  rays[3] = {0.125F, -0.0625F, 1.0F};  // meets z = 4 at (0.5, -0.25): triangle 0
  rays[18] = {-0.05F, 0.1F, 2.0F};     // meets z = 4 at (-0.1, 0.2): triangle 1
  std::vector<SurfaceHit> hits(rays.size());
  mesh_.nearest(rays, hits);
  for (std::size_t i = 0; i < hits.size(); ++i) {
    EXPECT_EQ(hits[i].found(), i == 3 || i == 18) << "ray " << i;
  }
  for (const std::size_t i : {std::size_t{3}, std::size_t{18}}) {
    ASSERT_LT(hits[i].triangle, 2U);
    const Triangle& t = triangles_[hits[i].triangle];
    const Eigen::Vector3f place = (1.0F - hits[i].u - hits[i].v) * corners_[t[0]] +
                                  hits[i].u * corners_[t[1]] + hits[i].v * corners_[t[2]];
    EXPECT_LT((place - hits[i].distance * rays[i]).norm(), 1e-5F);
  }
  EXPECT_FLOAT_EQ(hits[3].distance, 4.0F);
  EXPECT_FLOAT_EQ(hits[18].distance, 2.0F);
}

TEST_F(TwoSquares, BlockedAsksForAnythingAheadOfTheOrigin) {
  const std::vector<Eigen::Vector3f> origins{{0, 0, 0}, {0, 0, 5}, {0, 0, 10}, {3, 0, 0}};
  std::vector<std::uint8_t> blocked(origins.size());
  mesh_.blocked(origins, Eigen::Vector3f::UnitZ(), blocked);
  EXPECT_EQ(blocked, (std::vector<std::uint8_t>{1, 1, 0, 0}));
}

TEST_F(TwoSquares, RefusesAnswersOfAnotherLength) {
  const std::vector<Eigen::Vector3f> rays(2, Eigen::Vector3f::UnitZ());
  std::vector<SurfaceHit> hits(3);
  EXPECT_THROW(mesh_.nearest(rays, hits), std::invalid_argument);
  std::vector<std::uint8_t> blocked(1);
  EXPECT_THROW(mesh_.blocked(rays, Eigen::Vector3f::UnitZ(), blocked), std::invalid_argument);
}

}  // namespace
}  // namespace q3d::pipeline::render
