// The metrics against the official evaluator: eight samples, among them one without a visible keypoint, one
// with a tiny mask, one with weights of 2, one mirrored and one with an empty mask.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "filters/metrics.h"
#include "smal/tensors/body.h"
#include "smal/tensors/rotation.h"
#include "smal/tensors/safetensors.h"
#include "tests/support/parity_smal.h"
#include "tests/support/paths.h"

namespace q3d::filters {
namespace {

constexpr double kTolerance = 1e-5;  // relative; absolute below 1
constexpr double kFullCropPx = 256.0;

void expect_close(double got, double expected, const std::string& what) {
  EXPECT_NEAR(got, expected, kTolerance * std::max(1.0, std::abs(expected))) << what;
}

// The official code aligns in float32, whose step at a metre is 1.2e-4 mm: what it finds where nothing is
// wrong.
void expect_close_mm(double got, double expected, const std::string& what) {
  constexpr double kFloat32StepMm = 1.2e-4;
  EXPECT_NEAR(got, expected, std::max(kFloat32StepMm, kTolerance * expected)) << what;
}

std::span<const float> view(const torch::Tensor& tensor) {
  return {tensor.data_ptr<float>(), static_cast<std::size_t>(tensor.numel())};
}

class MetricsParity : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    file_ = new smal::tensors::SafeTensors(
        smal::tensors::SafeTensors::open(testing::parity_dir() / "metrics.safetensors"));
    std::ifstream stream(testing::parity_dir() / "metrics.json");
    cases_ = nlohmann::json::parse(stream).at("meta").at("cases").get<std::vector<std::string>>();
  }
  static void TearDownTestSuite() { delete file_; }

  static torch::Tensor golden(const char* name) { return file_->tensor(name); }
  static torch::Tensor golden(const char* name, std::size_t i) {
    return file_->tensor(name)[static_cast<std::int64_t>(i)].contiguous();
  }
  static double number(const char* name, std::size_t i) { return golden(name, i).item<double>(); }

  static double normaliser_px(std::size_t i) { return std::sqrt(number("mask_sum", i)); }
  // With the official rule: no visible keypoint counts as 0.
  static double official_pck(std::size_t i, double normaliser, double threshold) {
    return pck(view(golden("pred_keypoints_2d", i)), view(golden("gt_keypoints_2d", i)), normaliser,
               threshold)
        .value_or(0.0);
  }
  static double official_auc(std::size_t i, double normaliser) {
    return auc(view(golden("pred_keypoints_2d", i)), view(golden("gt_keypoints_2d", i)), normaliser)
        .value_or(0.0);
  }
  static torch::Tensor true_keypoints_3d(std::size_t i) {
    return golden("gt_keypoints_3d", i).slice(1, 0, 3).contiguous();
  }
  static double pa_mpjpe(std::size_t i) {
    return procrustes_error_mm(view(golden("pred_keypoints_3d", i)), view(true_keypoints_3d(i)));
  }
  // (cases, V, 3): the evaluator's own body.
  static torch::Tensor true_vertices() {
    const smal::tensors::SmalBody body(testing::load_parity_asset(testing::parity_dir()));
    const torch::Tensor axis_angle = torch::cat({golden("smal_global_orient"), golden("smal_pose")}, 1);
    const torch::Tensor rotations =
        smal::tensors::axis_angle_to_matrix_exact(axis_angle.reshape({axis_angle.size(0), -1, 3}));
    return body.forward(rotations, golden("smal_betas"), golden("smal_transl")).vertices;
  }
  static torch::Tensor predicted_vertices() {
    return golden("pred_vertices_i16").to(torch::kFloat32) * std::ldexp(1.0, -11);
  }

  static inline smal::tensors::SafeTensors* file_ = nullptr;
  static inline std::vector<std::string> cases_;
};

TEST_F(MetricsParity, Pck) {
  ASSERT_EQ(cases_.size(), static_cast<std::size_t>(golden("pck").size(0)));
  for (std::size_t i = 0; i < cases_.size(); ++i) {
    const torch::Tensor expected = golden("pck", i);
    expect_close(official_pck(i, normaliser_px(i), 0.10), expected[0].item<double>(), cases_[i] + " @0.10");
    expect_close(official_pck(i, normaliser_px(i), 0.15), expected[1].item<double>(), cases_[i] + " @0.15");
  }
}

TEST_F(MetricsParity, PckCurve) {
  for (std::size_t i = 0; i < cases_.size(); ++i) {
    const torch::Tensor expected = golden("pck_curve", i);
    const std::int64_t count = expected.size(0);
    for (std::int64_t t = 0; t < count; ++t) {
      const double threshold = static_cast<double>(t) / static_cast<double>(count - 1);
      expect_close(official_pck(i, normaliser_px(i), threshold), expected[t].item<double>(),
                   cases_[i] + " @" + std::to_string(threshold));
    }
  }
}

TEST_F(MetricsParity, Auc) {
  for (std::size_t i = 0; i < cases_.size(); ++i) {
    expect_close(official_auc(i, normaliser_px(i)), number("auc", i), cases_[i]);
  }
}

TEST_F(MetricsParity, WithoutAMaskTheWholeCropNormalises) {
  const torch::Tensor expected = golden("nomask_pck_case0");
  expect_close(official_pck(0, kFullCropPx, 0.10), expected[0].item<double>(), "@0.10");
  expect_close(official_pck(0, kFullCropPx, 0.15), expected[1].item<double>(), "@0.15");
  expect_close(official_auc(0, kFullCropPx), number("nomask_auc_case0", 0), "auc");
}

TEST_F(MetricsParity, ProcrustesAlignedKeypoints) {
  for (std::size_t i = 0; i < cases_.size(); ++i) {
    const auto aligned = procrustes_align(view(golden("pred_keypoints_3d", i)), view(true_keypoints_3d(i)));
    const torch::Tensor golden_points = golden("procrustes_joints", i);
    const auto expected = view(golden_points);
    ASSERT_EQ(aligned.size(), expected.size());
    for (std::size_t k = 0; k < expected.size(); ++k) expect_close(aligned[k], expected[k], cases_[i]);
  }
}

TEST_F(MetricsParity, PaMpjpe) {
  for (std::size_t i = 0; i < cases_.size(); ++i)
    expect_close_mm(pa_mpjpe(i), number("pa_mpjpe", i), cases_[i]);
}

TEST_F(MetricsParity, PaMpvpe) {
  const torch::Tensor truth = true_vertices();
  const torch::Tensor predicted = predicted_vertices();
  const torch::Tensor sampled = truth.slice(1, 0, truth.size(1), 32);
  ASSERT_EQ(sampled.sizes(), golden("gt_vertices_every32").sizes());
  EXPECT_LE((sampled - golden("gt_vertices_every32")).abs().max().item<double>(), kTolerance);
  for (std::size_t i = 0; i < cases_.size(); ++i) {
    const auto row = static_cast<std::int64_t>(i);
    const double error =
        procrustes_error_mm(view(predicted[row].contiguous()), view(truth[row].contiguous()));
    expect_close_mm(error, number("pa_mpvpe", i), cases_[i]);
  }
}

// The evaluator's batch numbers are means over the samples, those without a visible keypoint included as 0.
TEST_F(MetricsParity, BatchMeans) {
  constexpr std::size_t kFirst = 7;
  double pck_10 = 0.0;
  double pck_15 = 0.0;
  double area = 0.0;
  for (std::size_t i = 0; i < kFirst; ++i) {
    pck_10 += official_pck(i, normaliser_px(i), 0.10) / kFirst;
    pck_15 += official_pck(i, normaliser_px(i), 0.15) / kFirst;
    area += official_auc(i, normaliser_px(i)) / kFirst;
  }
  expect_close(pck_10, golden("batch_pck_first7")[0].item<double>(), "pck @0.10");
  expect_close(pck_15, golden("batch_pck_first7")[1].item<double>(), "pck @0.15");
  expect_close(area, number("batch_auc_first7", 0), "auc");

  const torch::Tensor truth = true_vertices();
  const torch::Tensor predicted = predicted_vertices();
  const auto count = static_cast<double>(cases_.size());
  double joints = 0.0;
  double vertices = 0.0;
  for (std::size_t i = 0; i < cases_.size(); ++i) {
    const auto row = static_cast<std::int64_t>(i);
    joints += pa_mpjpe(i) / count;
    vertices += procrustes_error_mm(view(predicted[row].contiguous()), view(truth[row].contiguous())) / count;
  }
  expect_close_mm(joints, number("batch_pa_mpjpe", 0), "pa_mpjpe");
  expect_close_mm(vertices, number("batch_pa_mpvpe", 0), "pa_mpvpe");
}

TEST_F(MetricsParity, OnlyASampleWithoutVisibleKeypointsHasNoValue) {
  for (std::size_t i = 0; i < cases_.size(); ++i) {
    const auto value =
        pck(view(golden("pred_keypoints_2d", i)), view(golden("gt_keypoints_2d", i)), normaliser_px(i), 0.1);
    EXPECT_EQ(value.has_value(), cases_[i] != "zerovis") << cases_[i];
  }
}

}  // namespace
}  // namespace q3d::filters
