// smal/ against numbers computed by the official code.
#include <gtest/gtest.h>

#include "smal/tensors/body.h"
#include "smal/tensors/camera.h"
#include "smal/tensors/rotation.h"
#include "smal/tensors/safetensors.h"
#include "tests/support/parity_smal.h"
#include "tests/support/paths.h"

namespace q3d::smal::tensors {
namespace {

constexpr double kTolerance = 1e-5;

// Shapes first, then the largest difference.
void expect_close(const torch::Tensor& got, const torch::Tensor& expected, double tolerance = kTolerance) {
  ASSERT_EQ(got.sizes(), expected.sizes());
  ASSERT_TRUE(got.isfinite().all().item<bool>());
  const double worst = (got.to(torch::kFloat64) - expected.to(torch::kFloat64)).abs().max().item<double>();
  EXPECT_LE(worst, tolerance);
}

class SmalParity : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    file_ = new SafeTensors(SafeTensors::open(testing::parity_dir() / "smal.safetensors"));
    body_ = new SmalBody(testing::load_parity_asset(testing::parity_dir()));
  }
  static void TearDownTestSuite() {
    delete body_;
    delete file_;
  }
  static torch::Tensor golden(const char* name) { return file_->tensor(name); }
  static BodyOutput golden_body() {
    return body_->forward(golden("rotmats"), golden("betas"), golden("transl"));
  }

  static inline SafeTensors* file_ = nullptr;
  static inline SmalBody* body_ = nullptr;
};

TEST_F(SmalParity, Rot6dIncludingDegenerateRows) {
  expect_close(rot6d_to_matrix(golden("rot6d_in")), golden("rot6d_out"));
}

TEST_F(SmalParity, AxisAngleToMatrix) {
  expect_close(axis_angle_to_matrix(golden("axis_angle")), golden("rotmats"));
}

TEST_F(SmalParity, MatrixToAxisAngle) {
  expect_close(matrix_to_axis_angle(golden("rotmats")), golden("matrix_to_axis_angle"));
}

TEST_F(SmalParity, Vertices) {
  const torch::Tensor vertices = golden_body().vertices;
  expect_close(vertices.slice(1, 0, vertices.size(1), 8), golden("vertices_every8"));
  expect_close(vertices.slice(0, 0, 2), golden("vertices_first2"));
  // Means over all vertices reach those that the samples above skip. Rounding in the joints moves many
  // vertices alike, so it does not average out below one float32 step at this size.
  const auto count = static_cast<double>(vertices.size(1));
  const torch::Tensor exact = vertices.to(torch::kFloat64);
  expect_close(exact.mean(1), golden("vertex_sum") / count, 1e-6);
  expect_close(exact.abs().mean(1), golden("vertex_abs_sum") / count, 1e-6);
}

TEST_F(SmalParity, Keypoints) {
  expect_close(golden_body().keypoints, golden("joints26"));
  expect_close(body_->keypoints(golden("rotmats"), golden("betas"), golden("transl")), golden("joints26"));
}

TEST_F(SmalParity, KinematicJoints) {
  expect_close(golden_body().joints, golden("joints35"));
}

TEST_F(SmalParity, PerspectiveProjection) {
  expect_close(perspective_projection(golden("proj_points"), golden("proj_trans"), golden("proj_focal")),
               golden("proj_out"));
}

TEST_F(SmalParity, CameraOfTheFullImage) {
  expect_close(camera_crop_to_full(golden("camfull_cam"), golden("camfull_center"), golden("camfull_size"),
                                   golden("camfull_imgsize"), golden("camfull_focal").item<double>()),
               golden("camfull_out"));
}

}  // namespace
}  // namespace q3d::smal::tensors
