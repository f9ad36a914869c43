#include "pipeline/unit/annotated_body.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace q3d::pipeline::unit {
namespace {

using manifests::BodyTruth;

// A body ten units before the camera, with keypoint 0 at (0.5, -0.25, 0) and the others at the origin.
BodyTruth truth() {
  BodyTruth body;
  body.has_pose = body.has_betas = body.has_keypoints_3d = true;
  body.pose_axis_angle[2] = static_cast<float>(std::numbers::pi / 2);
  body.betas[40] = 1.5F;
  body.trans = {0.1F, 0.2F, 10.0F};
  body.keypoints_3d[0] = 0.5F;
  body.keypoints_3d[1] = -0.25F;
  return body;
}

void expect_rotation(const device::BodyPrediction& body, std::size_t joint,
                     const std::array<float, 9>& expected) {
  for (std::size_t i = 0; i < 9; ++i)
    EXPECT_NEAR(body.pose[9 * joint + i], expected[i], 1e-6F) << joint << ' ' << i;
}

TEST(AnnotatedBody, RotationsComeFromAxisAndAngle) {
  BodyTruth body = truth();
  const auto third = static_cast<float>(2.0 * std::numbers::pi / 3.0 / std::numbers::sqrt3);
  for (std::size_t i = 3; i < 6; ++i) body.pose_axis_angle[i] = third;  // a third of a turn about (1, 1, 1)
  body.pose_axis_angle[3 * 34] = static_cast<float>(std::numbers::pi);  // half a turn about x
  const device::BodyPrediction made = annotated_body(body);
  expect_rotation(made, 0, {0, -1, 0, 1, 0, 0, 0, 0, 1});
  expect_rotation(made, 1, {0, 0, 1, 1, 0, 0, 0, 1, 0});  // x to y, y to z, z to x
  expect_rotation(made, 2, {1, 0, 0, 0, 1, 0, 0, 0, 1});
  expect_rotation(made, 34, {1, 0, 0, 0, -1, 0, 0, 0, -1});
}

TEST(AnnotatedBody, ProjectsWithFocal1000OnACropOf256) {
  const device::BodyPrediction made = annotated_body(truth());
  ASSERT_TRUE(has_projection(made.keypoints_2d));
  EXPECT_NEAR(made.keypoints_2d[0].x, 1000.0 / 256.0 * 0.6 / 10.0, 1e-6);
  EXPECT_NEAR(made.keypoints_2d[0].y, 1000.0 / 256.0 * -0.05 / 10.0, 1e-6);
  EXPECT_NEAR(made.keypoints_2d[1].x, 1000.0 / 256.0 * 0.1 / 10.0, 1e-6);
  EXPECT_NEAR(made.camera.s, 2.0 * 1000.0 / (256.0 * 10.0), 1e-6);
  EXPECT_EQ(made.camera.tx, 0.1F);
  EXPECT_EQ(made.betas[40], 1.5F);
  EXPECT_EQ(made.translation[2], 10.0F);
  EXPECT_EQ(missing_parts(truth()), "");
}

TEST(AnnotatedBody, WithoutATranslationThereIsNoProjection) {
  BodyTruth body = truth();
  body.trans = {};
  const device::BodyPrediction made = annotated_body(body);
  EXPECT_FALSE(has_projection(made.keypoints_2d));
  EXPECT_TRUE(std::isnan(made.camera.s));
  EXPECT_EQ(made.keypoints_3d[0], 0.5F);  // still a label
  EXPECT_EQ(missing_parts(body), "the file gives no trans that puts the body before the camera");
}

TEST(AnnotatedBody, APointBehindTheCameraLeavesNoProjection) {
  BodyTruth body = truth();
  body.keypoints_3d[3 * 25 + 2] = -11.0F;
  EXPECT_FALSE(has_projection(annotated_body(body).keypoints_2d));
  EXPECT_NE(missing_parts(body), "");
}

TEST(AnnotatedBody, SaysWhatTheFileLacks) {
  BodyTruth body = truth();
  body.has_betas = body.has_keypoints_3d = false;
  body.betas = {};
  body.keypoints_3d = {};
  EXPECT_FALSE(has_projection(annotated_body(body).keypoints_2d));
  EXPECT_EQ(missing_parts(body), "the file gives no shape, no keypoint_3d");
}

TEST(AnnotatedBody, NoBodyHasNoProjection) {
  EXPECT_FALSE(has_projection(no_body().keypoints_2d));
  EXPECT_EQ(no_body().pose[0], 0.0F);
}

}  // namespace
}  // namespace q3d::pipeline::unit
