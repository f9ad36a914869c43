#include "smal/body.h"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>

#include "smal/axis_angle.h"
#include "smal/numbers.h"

namespace q3d::smal {
namespace {

TEST(Body, TheSizesAreThoseOfTheOfficialAsset) {
  EXPECT_EQ(Pose().size(), 35U * 3U * 3U);
  EXPECT_EQ(AxisAnglePose().size(), 35U * 3U);
  EXPECT_EQ(Betas().size(), 41U);
  EXPECT_EQ(Keypoints3d().size(), 26U * 3U);
}

TEST(Body, TheCameraIsThatOfTheOfficialCrop) {
  EXPECT_EQ(kCropSidePx, 256);
  EXPECT_EQ(kFocalPx, 1000.0);
  EXPECT_EQ(kFocalInCropUnits, 3.90625);
}

TEST(Numbers, ACameraIsScaleThenShift) {
  const Camera camera{.s = 1.5F, .tx = 2.5F, .ty = 3.5F};
  EXPECT_EQ(numbers_of(camera), (std::array{1.5F, 2.5F, 3.5F}));
  EXPECT_EQ(from_numbers<Camera>({1.5F, 2.5F, 3.5F}), camera);
}

TEST(Numbers, ABodyHasNoGaps) {
  Body body;
  body.pose.front() = 1.0F;
  body.pose.back() = 2.0F;
  body.betas.back() = 3.0F;
  body.camera.ty = 4.0F;
  body.translation.back() = 5.0F;
  const auto numbers = numbers_of(body);
  ASSERT_EQ(numbers.size(), 315U + 41U + 3U + 3U);
  EXPECT_EQ(numbers[0], 1.0F);
  EXPECT_EQ(numbers[314], 2.0F);
  EXPECT_EQ(numbers[355], 3.0F);
  EXPECT_EQ(numbers[358], 4.0F);
  EXPECT_EQ(numbers[361], 5.0F);
}

// A quarter turn about x brings y to z; rows come first.
TEST(RotationMatrices, AreRowMajor) {
  AxisAnglePose turns{};
  turns[3 * 34] = 1.57079632679F;
  const Pose matrices = rotation_matrices(turns);
  const std::array<float, 9> identity{1, 0, 0, 0, 1, 0, 0, 0, 1};
  const std::array<float, 9> quarter{1, 0, 0, 0, 0, -1, 0, 1, 0};
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_NEAR(matrices[i], identity[i], 1e-6F) << i;
    EXPECT_NEAR(matrices[9 * 34 + i], quarter[i], 1e-6F) << i;
  }
}

}  // namespace
}  // namespace q3d::smal
