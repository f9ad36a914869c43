// smal/ against numbers computed by the official code.
//
// The official code computed in float32, on another processor. We compute in float64 from the same inputs,
// where rounding does not count, so that what is left is the golden numbers' own rounding. Each tolerance is
// a number of float32 roundings times what the function makes of one.
#include <gtest/gtest.h>

#include "smal/tensors/body.h"
#include "smal/tensors/camera.h"
#include "smal/tensors/rotation.h"
#include "smal/tensors/safetensors.h"
#include "tests/support/parity_smal.h"
#include "tests/support/paths.h"

namespace q3d::smal::tensors {
namespace {

using torch::indexing::Ellipsis;
using torch::indexing::Slice;

// The largest relative change that rounding to float32 makes to a number.
constexpr double kRounding = 0x1p-24;

// A short formula rounds some ten times; the errors partly cancel.
constexpr double kFormula = 8.0 * kRounding;

// Relative to the body's extent, each times a distance below it: a vertex is the end of a chain of up to
// twelve joints with a rotation and a shift each, then comes a mean over its joints, the blend shapes and the
// shift.
constexpr double kBody = 24.0 * kRounding;

torch::Tensor exact(const torch::Tensor& tensor) {
  return tensor.to(torch::kFloat64);
}

double largest(const torch::Tensor& tensor) {
  return tensor.abs().max().item<double>();
}

torch::Tensor length(const torch::Tensor& vectors) {
  return vectors.norm(2, -1, /*keepdim=*/true);
}

// Shapes first, then finite numbers, then the largest difference relative to the tolerance, which may be
// broadcast.
void expect_close(const torch::Tensor& got, const torch::Tensor& expected, const torch::Tensor& tolerance) {
  ASSERT_EQ(got.sizes(), expected.sizes());
  ASSERT_TRUE(got.isfinite().all().item<bool>());
  const torch::Tensor error = (exact(got) - exact(expected)).abs();
  const std::int64_t worst = (error / tolerance).argmax().item<std::int64_t>();
  EXPECT_LE((error / tolerance).max().item<double>(), 1.0)
      << "difference " << error.flatten()[worst].item<double>() << " at element " << worst << ", tolerance "
      << tolerance.expand_as(error).flatten()[worst].item<double>();
}

void expect_close(const torch::Tensor& got, const torch::Tensor& expected, double tolerance) {
  expect_close(got, expected, torch::tensor(tolerance, torch::kFloat64));
}

class SmalParity : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    file_ = new SafeTensors(SafeTensors::open(testing::parity_dir() / "smal.safetensors"));
    body_ =
        new SmalBody(SmalBody(testing::load_parity_asset(testing::parity_dir())).to_dtype(torch::kFloat64));
  }
  static void TearDownTestSuite() {
    delete body_;
    delete file_;
  }
  static torch::Tensor golden(const char* name) { return exact(file_->tensor(name)); }
  static BodyOutput golden_body() {
    return body_->forward(golden("rotmats"), golden("betas"), golden("transl"));
  }
  // The extent of a body before and after it is moved.
  static double extent() { return largest(golden("vertices_every8")) + largest(golden("transl")); }

  static inline SafeTensors* file_ = nullptr;
  static inline SmalBody* body_ = nullptr;
};

// Returns how much larger rounding errors are in the second and third column than in the numbers. The second
// column is what is left of the second vector across the first, brought to length 1. Where the two are
// parallel hardly anything but rounding is left, and the columns may point anywhere. The guard against short
// vectors (1e-12) keeps the number finite.
torch::Tensor condition(const torch::Tensor& rot6d) {
  const torch::Tensor first = rot6d.index({Ellipsis, Slice(0, 3)});
  const torch::Tensor second = rot6d.index({Ellipsis, Slice(3, 6)});
  const torch::Tensor direction = first / length(first).clamp_min(1e-12);
  const torch::Tensor across = second - (direction * second).sum(-1, true) * direction;
  return length(second) / length(across).clamp_min(1e-12);
}

TEST_F(SmalParity, Rot6dByTheConditionOfEachRow) {
  const torch::Tensor rot6d = golden("rot6d_in");
  const torch::Tensor matrices = rot6d_to_matrix(rot6d);
  const torch::Tensor expected = golden("rot6d_out");
  expect_close(matrices.select(-1, 0), expected.select(-1, 0), kFormula);
  const torch::Tensor tolerance = kFormula * (1.0 + condition(rot6d));
  expect_close(matrices.select(-1, 1), expected.select(-1, 1), tolerance);
  expect_close(matrices.select(-1, 2), expected.select(-1, 2), tolerance);
  // Most rows must be judged strictly, or the test says little.
  EXPECT_GE((tolerance < 1e-5).to(torch::kFloat64).mean().item<double>(), 0.9);
}

// The angle's rounding is relative to it, and a matrix turns as much as its angle does.
TEST_F(SmalParity, AxisAngleToMatrix) {
  const torch::Tensor axis_angle = golden("axis_angle");
  expect_close(axis_angle_to_matrix(axis_angle), golden("rotmats"),
               kFormula * (1.0 + length(axis_angle)).unsqueeze(-1));
}

// The official formula takes the angle t from the trace, by the arc cosine, and multiplies the antisymmetric
// part by t / (2 sin t). Rounding of the trace comes out times |sin t - t cos t| / sin^2 t, that of the
// antisymmetric part times t / sin t: both are small but near half turns.
TEST_F(SmalParity, MatrixToAxisAngleByTheConditionOfEachRow) {
  const torch::Tensor matrices = golden("rotmats");
  const torch::Tensor angle = length(matrix_to_axis_angle_smooth(matrices)).clamp(1e-6, M_PI - 1e-6);
  const torch::Tensor sine = angle.sin();
  const torch::Tensor amplified = (sine - angle * angle.cos()).abs() / sine.square() + angle / sine;
  expect_close(matrix_to_axis_angle(matrices), golden("matrix_to_axis_angle"), kFormula * (1.0 + amplified));
  EXPECT_GE((amplified < 100.0).to(torch::kFloat64).mean().item<double>(), 0.9);
}

TEST_F(SmalParity, Vertices) {
  const torch::Tensor vertices = golden_body().vertices;
  const double tolerance = kBody * extent();
  expect_close(vertices.slice(1, 0, vertices.size(1), 8), golden("vertices_every8"), tolerance);
  expect_close(vertices.slice(0, 0, 2), golden("vertices_first2"), tolerance);
  // Means over all vertices reach those that the samples above skip. Rounding in the joints moves many
  // vertices alike, so that it does not average out, but the roundings of single vertices do.
  const auto count = static_cast<double>(vertices.size(1));
  expect_close(vertices.mean(1), golden("vertex_sum") / count, 0.25 * tolerance);
  expect_close(vertices.abs().mean(1), golden("vertex_abs_sum") / count, 0.25 * tolerance);
}

TEST_F(SmalParity, Keypoints) {
  const double tolerance = kBody * extent();
  expect_close(golden_body().keypoints, golden("joints26"), tolerance);
  expect_close(body_->keypoints(golden("rotmats"), golden("betas"), golden("transl")), golden("joints26"),
               tolerance);
}

TEST_F(SmalParity, KinematicJoints) {
  expect_close(golden_body().joints, golden("joints35"), kBody * extent());
}

// Each rounding is relative to the numbers that are added, before they cancel.
TEST_F(SmalParity, PerspectiveProjection) {
  const torch::Tensor points = golden("proj_points");
  const torch::Tensor translation = golden("proj_trans");
  const torch::Tensor focal = golden("proj_focal");
  const torch::Tensor moved = points + translation.unsqueeze(1);
  const torch::Tensor added = points.abs() + translation.abs().unsqueeze(1);
  const torch::Tensor depth = moved.narrow(2, 2, 1).abs();
  const torch::Tensor across = moved.narrow(2, 0, 2).abs() / depth;
  const torch::Tensor terms = added.narrow(2, 0, 2) / depth + across * added.narrow(2, 2, 1) / depth;
  expect_close(perspective_projection(points, translation, focal), golden("proj_out"),
               kFormula * terms * focal.unsqueeze(1));
}

TEST_F(SmalParity, CameraOfTheFullImage) {
  const torch::Tensor camera = golden("camfull_cam");
  const torch::Tensor centre = golden("camfull_center");
  const torch::Tensor image = golden("camfull_imgsize");
  const torch::Tensor got = camera_crop_to_full(camera, centre, golden("camfull_size"), image,
                                                golden("camfull_focal").item<double>());
  const torch::Tensor scaled_box = (golden("camfull_size") * camera.select(1, 0)).abs().unsqueeze(1);
  const torch::Tensor added = camera.narrow(1, 1, 2).abs() + 2.0 * (centre.abs() + image / 2.0) / scaled_box;
  expect_close(got, golden("camfull_out"), kFormula * torch::cat({added, got.narrow(1, 2, 1).abs()}, 1));
}

// float32 is what users run. Both sides round here, on this processor.
TEST_F(SmalParity, Float32BodyIsNear) {
  const SmalBody single(testing::load_parity_asset(testing::parity_dir()));
  const auto given = [](const char* name) { return file_->tensor(name); };
  const BodyOutput body = single.forward(given("rotmats"), given("betas"), given("transl"));
  EXPECT_EQ(body.vertices.scalar_type(), torch::kFloat32);
  const double tolerance = 4.0 * kBody * extent();
  expect_close(body.vertices, golden_body().vertices, tolerance);
  expect_close(body.keypoints, golden("joints26"), tolerance);
  expect_close(body.joints, golden("joints35"), tolerance);
}

}  // namespace
}  // namespace q3d::smal::tensors
