// Metrics against numbers worked out by hand.
#include "filters/metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

namespace q3d::filters {
namespace {

using Projected = smal::CropPoints;
using Annotated = smal::CropKeypoints;

// Keypoint k is annotated at the origin with weight `weight` and projected to (x, y).
void place(Projected& projected, Annotated& annotated, std::size_t k, float x, float y, float weight) {
  projected[k] = {x, y};
  annotated[k].weight = weight;
}

TEST(ProjectionError, IsTheMeanOverVisibleKeypointsAndCoordinates) {
  Projected projected{};
  Annotated annotated{};
  place(projected, annotated, 0, 0.25F, -0.5F, 1.0F);
  place(projected, annotated, 25, 0.0F, 0.125F, 0.5F);   // the weight only says visible
  place(projected, annotated, 3, 100.0F, 100.0F, 0.0F);  // invisible
  place(projected, annotated, 4, 100.0F, 100.0F, -1.0F);
  EXPECT_EQ(projection_error(projected, annotated), (0.25 + 0.5 + 0.0 + 0.125) / 4);
}

TEST(ProjectionError, IsEmptyWithoutVisibleKeypoints) {
  EXPECT_FALSE(projection_error(Projected{}, Annotated{}));
}

TEST(Pck, IsStrictAndWeighted) {
  Projected projected{};
  Annotated annotated{};
  // Distances of 16, 32 and 0 px with a normaliser of 128 px: 0.125, 0.25 and 0.
  place(projected, annotated, 0, 0.0625F, 0.0F, 1.0F);
  place(projected, annotated, 1, 0.0F, -0.125F, 0.5F);
  place(projected, annotated, 2, 0.0F, 0.0F, 2.0F);
  EXPECT_EQ(pck(projected, annotated, 128.0, 0.125), 2.0 / 3.5);
  EXPECT_EQ(pck(projected, annotated, 128.0, 0.126), 3.0 / 3.5);
  EXPECT_EQ(pck(projected, annotated, 128.0, 0.25), 3.0 / 3.5);
  EXPECT_EQ(pck(projected, annotated, 128.0, 0.26), 1.0);
  EXPECT_EQ(pck(projected, annotated, 128.0, 0.0), 0.0);
  EXPECT_EQ(pck(projected, annotated, 0.0, 1.0), 0.0) << "an empty mask";
  EXPECT_FALSE(pck(projected, Annotated{}, 128.0, 0.1));
}

TEST(Auc, OfAPerfectSampleMissesOnlyThresholdZero) {
  Annotated annotated{};
  annotated[0].weight = 1.0F;
  EXPECT_NEAR(*auc(Projected{}, annotated, 100.0), 1.0 - 0.5 / 99.0, 1e-12);
  EXPECT_FALSE(auc(Projected{}, Annotated{}, 100.0));
}

TEST(Auc, OfOneDistanceIsTheAreaBeyondIt) {
  Projected projected{};
  Annotated annotated{};
  place(projected, annotated, 0, 0.5F, 0.0F, 1.0F);  // 128 of 256 px: 0.5, between thresholds 49/99 and 50/99
  EXPECT_NEAR(*auc(projected, annotated, 256.0), 49.0 / 99.0 + 0.5 / 99.0, 1e-12);
}

const std::vector<float> kTetrahedron{0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3};

// Turned by 90 degrees about z, scaled and moved.
std::vector<float> similar(float scale, float shift) {
  std::vector<float> moved;
  for (std::size_t i = 0; i < kTetrahedron.size(); i += 3) {
    moved.push_back(-scale * kTetrahedron[i + 1] + shift);
    moved.push_back(scale * kTetrahedron[i] - shift);
    moved.push_back(scale * kTetrahedron[i + 2]);
  }
  return moved;
}

TEST(Procrustes, IgnoresRotationScaleAndTranslation) {
  EXPECT_NEAR(procrustes_error_mm(similar(0.25F, 7.0F), kTetrahedron), 0.0, 1e-4);
  const auto aligned = procrustes_align(similar(4.0F, -3.0F), kTetrahedron);
  for (std::size_t i = 0; i < aligned.size(); ++i) EXPECT_NEAR(aligned[i], kTetrahedron[i], 1e-6);
}

TEST(Procrustes, DoesNotMirror) {
  std::vector<float> mirrored = kTetrahedron;
  for (std::size_t i = 0; i < mirrored.size(); i += 3) mirrored[i] = -mirrored[i];
  EXPECT_GT(procrustes_error_mm(mirrored, kTetrahedron), 100.0);
}

// Two points against two points: the best scale s of lengths 2 -> 2 along a line leaves nothing; against
// three collinear points (-1, 0, 1) -> (-1, 0.3, 1) it can be worked out by hand.
TEST(Procrustes, MatchesAHandComputedResidual) {
  const std::vector<float> predicted{-1, 0, 0, 0, 0, 0, 1, 0, 0};
  const std::vector<float> truth{-1, 0, 0, 0.3F, 0, 0, 1, 0, 0};
  // Centred truth: (-1.1, 0.2, 0.9); scale = (1.1 + 0.9) / 2 = 1; aligned = (-0.9, 0.1, 1.1).
  EXPECT_NEAR(procrustes_error_mm(predicted, truth), 1000.0 * (0.1 + 0.2 + 0.1) / 3, 1e-3);
}

TEST(Procrustes, PointsThatCoincideGoToTheCentre) {
  const std::vector<float> truth{-1, 0, 0, 1, 0, 0};
  EXPECT_DOUBLE_EQ(procrustes_error_mm(std::vector<float>(6, 5.0F), truth), 1000.0);
}

TEST(Procrustes, NonFiniteNumbersGiveNanAndWrongCountsThrow) {
  std::vector<float> broken = kTetrahedron;
  broken[4] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_TRUE(std::isnan(procrustes_error_mm(broken, kTetrahedron)));
  EXPECT_TRUE(std::isnan(procrustes_error_mm(kTetrahedron, broken)));
  EXPECT_THROW(procrustes_error_mm(std::vector<float>(9), kTetrahedron), std::invalid_argument);
  EXPECT_THROW(procrustes_error_mm(std::vector<float>(), std::vector<float>()), std::invalid_argument);
  EXPECT_THROW(procrustes_align(std::vector<float>(4), std::vector<float>(4)), std::invalid_argument);
}

}  // namespace
}  // namespace q3d::filters
