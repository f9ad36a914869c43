#include "pipeline/evaluation/metric.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "pipeline/animal/synthetic_files.h"
#include "pipeline/device/network.h"
#include "pipeline/network/torch_bodies.h"
#include "smal/axis_angle.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::evaluation {
namespace {

constexpr double kSidePx = smal::kCropSidePx;

double value(const MetricValues& values, Metric metric) {
  return values[index_of(metric)].value_or(std::numeric_limits<double>::quiet_NaN());
}

// Ten visible keypoints on a line and sixteen hidden ones, predicted exactly.
struct Exact {
  device::BodyPrediction body;
  Target target;
  Exact() {
    for (std::size_t k = 0; k < manifests::kNumKeypoints; ++k) {
      const float x = 0.01F * static_cast<float>(k);
      body.keypoints_2d[k].x = x;
      target.keypoints[k] = {x, 0.0F, k < 10 ? 1.0F : 0.0F};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        body.keypoints_3d[3 * k + axis] = std::sin(static_cast<float>(3 * k + axis));
      }
    }
    target.keypoints_3d = body.keypoints_3d;
  }
};

TEST(Measure, AnExactPrediction) {
  const Exact exact;
  const MetricValues values = measure(exact.body, nullptr, exact.target);
  // 99 of 100 thresholds are passed, the first half a step: (98 + 1/2) / 99.
  EXPECT_NEAR(value(values, Metric::auc), 100.0 * 98.5 / 99.0, 1e-9);
  EXPECT_DOUBLE_EQ(value(values, Metric::pck_10), 100.0);
  EXPECT_DOUBLE_EQ(value(values, Metric::l_proj), 0.0);
  EXPECT_NEAR(value(values, Metric::pa_mpjpe), 0.0, 1e-3);
  EXPECT_FALSE(values[index_of(Metric::pa_mpvpe)].has_value());
}

// Four of ten keypoints are 20 px off: a mask of 160 x 160 px puts them at 0.125, between the two thresholds,
// the whole crop at 0.078, below both.
TEST(Measure, TheMaskSetsTheScale) {
  Exact exact;
  for (std::size_t k = 0; k < 4; ++k) exact.body.keypoints_2d[k].y += static_cast<float>(20.0 / kSidePx);
  exact.target.normaliser_px = 160.0;
  const MetricValues by_mask = measure(exact.body, nullptr, exact.target);
  EXPECT_NEAR(value(by_mask, Metric::pck_10), 60.0, 1e-9);
  EXPECT_NEAR(value(by_mask, Metric::pck_15), 100.0, 1e-9);
  EXPECT_NEAR(value(by_mask, Metric::l_proj), 4 * (20.0 / kSidePx) / 20, 1e-6);
  exact.target.normaliser_px = kSidePx;
  EXPECT_NEAR(value(measure(exact.body, nullptr, exact.target), Metric::pck_10), 100.0, 1e-9);
}

TEST(Measure, SizeAndTurnOfABodyDoNotCount) {
  Exact exact;
  for (std::size_t k = 0; k < manifests::kNumKeypoints; ++k) {
    const float* p = &(*exact.target.keypoints_3d)[3 * k];
    exact.body.keypoints_3d[3 * k] = -2.0F * p[1] + 5.0F;  // a quarter turn about z, twice the size, moved
    exact.body.keypoints_3d[3 * k + 1] = 2.0F * p[0];
    exact.body.keypoints_3d[3 * k + 2] = 2.0F * p[2] - 1.0F;
  }
  EXPECT_NEAR(value(measure(exact.body, nullptr, exact.target), Metric::pa_mpjpe), 0.0, 1e-2);
}

TEST(Measure, WithoutAVisibleKeypointOnly3dIsMeasured) {
  Exact exact;
  for (smal::CropKeypoint& keypoint : exact.target.keypoints) keypoint.weight = 0.0F;
  const MetricValues values = measure(exact.body, nullptr, exact.target);
  for (const MetricInfo& info : kMetrics) {
    EXPECT_EQ(values[index_of(info.metric)].has_value(), info.metric == Metric::pa_mpjpe) << info.key;
  }
}

TEST(MakeTarget, TakesTheMaskWhereThereIsOne) {
  manifests::SampleRecord record;
  record.box = {0, 0, 100, 100};
  const Target with_mask = make_target(record, 400.0);
  EXPECT_TRUE(with_mask.normalised_by_mask);
  EXPECT_DOUBLE_EQ(with_mask.normaliser_px, 20.0);
  const Target without = make_target(record, 0.0);
  EXPECT_FALSE(without.normalised_by_mask);
  EXPECT_DOUBLE_EQ(without.normaliser_px, kSidePx);
  EXPECT_FALSE(without.keypoints_3d.has_value());
}

TEST(MeanOf, LeavesOutWhatIsMissingOrCountsItAsZero) {
  MetricValues one, two, none;
  one[0] = 2.0;
  two[0] = 4.0;
  const std::vector<const MetricValues*> samples{&one, &none, &two};
  const MetricMean left_out = mean_of(samples, 0);
  EXPECT_DOUBLE_EQ(*left_out.mean, 3.0);
  EXPECT_EQ(left_out.samples, 2);
  const MetricMean as_zero = mean_of(samples, 0, true);
  EXPECT_DOUBLE_EQ(*as_zero.mean, 2.0);
  EXPECT_EQ(as_zero.samples, 3);
  EXPECT_FALSE(mean_of(samples, 1).mean.has_value());
}

// A body whose truth is given as axis-angles must find its own mesh again; another shape must not.
TEST(AddTrueMeshes, TheTrueBodyHasNoError) {
  const testing::ScratchDir scratch;
  animal::write_synthetic_asset(scratch.path() / "smal.safetensors");
  const std::unique_ptr<device::BodyMeshes> meshes =
      network::load_body_meshes(scratch.path() / "smal.safetensors");
  manifests::SampleRecord record;
  record.truth.emplace();
  record.truth->has_pose = record.truth->has_betas = true;
  for (std::size_t i = 0; i < record.truth->pose_axis_angle.size(); ++i) {
    record.truth->pose_axis_angle[i] = 0.3F * std::sin(static_cast<float>(i));
  }
  record.truth->betas[0] = 1.0F;
  record.truth->betas[3] = -0.5F;
  const manifests::SampleRecord* pointer = &record;
  Target target = make_target(record, 0.0);
  add_true_meshes(std::span(&pointer, 1), *meshes, std::span(&target, 1));
  ASSERT_FALSE(target.vertices.empty());
  ASSERT_TRUE(target.keypoints_3d.has_value()) << "the record has none, so the body gives them";

  device::BodyPrediction body;
  body.pose = smal::rotation_matrices(record.truth->pose_axis_angle);
  body.betas = record.truth->betas;
  const auto error = [&] {
    const smal::Body& posed = body;
    const device::BodyMesh mesh = meshes->pose(std::span(&posed, 1)).front();
    body.keypoints_3d = mesh.keypoints_3d;
    return measure(body, &mesh, target);
  };
  EXPECT_NEAR(value(error(), Metric::pa_mpvpe), 0.0, 1e-2);
  EXPECT_NEAR(value(error(), Metric::pa_mpjpe), 0.0, 1e-2);
  body.betas[0] = -1.0F;
  EXPECT_GT(value(error(), Metric::pa_mpvpe), 1.0);
  EXPECT_THROW(measure(body, nullptr, target), std::logic_error);
}

TEST(RotationMatrices, AQuarterTurnAboutZ) {
  std::array<float, manifests::kNumJoints * 3> axis_angle{};
  axis_angle[3 * 4 + 2] = static_cast<float>(std::numbers::pi / 2);
  const auto matrices = smal::rotation_matrices(axis_angle);
  const std::array<float, 9> quarter{0, -1, 0, 1, 0, 0, 0, 0, 1};
  const std::array<float, 9> identity{1, 0, 0, 0, 1, 0, 0, 0, 1};
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_NEAR(matrices[9 * 4 + i], quarter[i], 1e-6);
    EXPECT_NEAR(matrices[i], identity[i], 1e-6);
  }
}

}  // namespace
}  // namespace q3d::pipeline::evaluation
