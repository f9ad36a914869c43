// The metrics against the official evaluator: eight samples, among them one without a visible keypoint, one
// with a tiny mask, one with weights of 2, one mirrored and one with an empty mask.
//
// The official code computes in float32, ours in float64. The differences are its rounding.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "filters/metrics.h"
#include "smal/numbers.h"
#include "smal/tensors/body.h"
#include "smal/tensors/rotation.h"
#include "smal/tensors/safetensors.h"
#include "tests/support/parity_smal.h"
#include "tests/support/paths.h"

namespace q3d::filters {
namespace {

// The largest relative change that rounding to float32 makes to a number.
constexpr double kRounding = 0x1p-24;

// Relative to the body's extent: a vertex is the end of a chain of up to twelve joints
// (tests/smal/tensors/parity_test.cpp).
constexpr double kBody = 24.0 * kRounding;

constexpr double kMmPerUnit = 1000.0;
constexpr double kFullCropPx = 256.0;

// The official code rounds a distance to float32 before it decides whether a keypoint is within a threshold.
// A threshold that is lower or higher by this share gives what it may have found instead.
constexpr double kThresholdShare = 8.0 * kRounding;

// A value is the quotient of two sums of 26 weights in float32.
constexpr double kQuotient = 8.0 * kRounding;

std::span<const float> view(const torch::Tensor& tensor) {
  return {tensor.data_ptr<float>(), static_cast<std::size_t>(tensor.numel())};
}

// The 26 rows of a golden tensor in crop units.
template <typename Values>
Values crop_values(const torch::Tensor& tensor) {
  smal::NumbersOf<Values> numbers{};
  const std::span<const float> values = view(tensor);
  if (values.size() != numbers.size()) throw std::runtime_error("the tensor has another count of numbers");
  std::copy(values.begin(), values.end(), numbers.begin());
  return smal::from_numbers<Values>(numbers);
}

// Returns how far float32 may move a point that it aligns, in the unit of the points: a few roundings of the
// largest coordinate for the scaled, turned and shifted point, and as many again times the condition of the
// rotation, which comes from the singular values s of a 3 x 3 matrix: s1 / (s2 + s3), with s3 negative where
// a mirror image must be avoided.
double alignment_rounding(const torch::Tensor& predicted, const torch::Tensor& truth) {
  const torch::Tensor from = predicted.to(torch::kFloat64);
  const torch::Tensor to = truth.to(torch::kFloat64);
  const auto [u, s, vh] = torch::linalg_svd(torch::matmul((from - from.mean(0)).t(), to - to.mean(0)));
  const double sign = torch::linalg_det(torch::matmul(u, vh)).item<double>() < 0 ? -1.0 : 1.0;
  const double condition = (s[0] / (s[1] + sign * s[2])).item<double>();
  return 4.0 * kRounding * (1.0 + condition) * to.abs().max().item<double>();
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

  // `found` as a function of the normaliser, which every distance is divided by. It rises with the
  // normaliser, because more keypoints are near enough.
  template <typename Metric>
  static void expect_within_rounding(const Metric& found, double normaliser, double expected,
                                     const std::string& what) {
    EXPECT_GE(expected, found(normaliser * (1.0 - kThresholdShare)) - kQuotient) << what;
    EXPECT_LE(expected, found(normaliser * (1.0 + kThresholdShare)) + kQuotient) << what;
  }
  static void expect_pck(std::size_t i, double normaliser, double threshold, double expected) {
    expect_within_rounding([&](double px) { return official_pck(i, px, threshold); }, normaliser, expected,
                           cases_[i] + " @" + std::to_string(threshold));
  }
  static void expect_auc(std::size_t i, double normaliser, double expected) {
    expect_within_rounding([&](double px) { return official_auc(i, px); }, normaliser, expected, cases_[i]);
  }

  static double normaliser_px(std::size_t i) { return std::sqrt(number("mask_sum", i)); }
  static smal::CropPoints projected(std::size_t i) {
    return crop_values<smal::CropPoints>(golden("pred_keypoints_2d", i));
  }
  static smal::CropKeypoints annotated(std::size_t i) {
    return crop_values<smal::CropKeypoints>(golden("gt_keypoints_2d", i));
  }
  // By the official rule, a sample without visible keypoints counts as 0.
  static double official_pck(std::size_t i, double normaliser, double threshold) {
    return pck(projected(i), annotated(i), normaliser, threshold).value_or(0.0);
  }
  static double official_auc(std::size_t i, double normaliser) {
    return auc(projected(i), annotated(i), normaliser).value_or(0.0);
  }
  static torch::Tensor true_keypoints_3d(std::size_t i) {
    return golden("gt_keypoints_3d", i).slice(1, 0, 3).contiguous();
  }
  static double pa_mpjpe(std::size_t i) {
    return procrustes_error_mm(view(golden("pred_keypoints_3d", i)), view(true_keypoints_3d(i)));
  }
  // (cases, V, 3) float64: the evaluator's own body.
  static torch::Tensor true_vertices() {
    const auto exact = [](const char* name) { return golden(name).to(torch::kFloat64); };
    const auto body =
        smal::tensors::SmalBody(testing::load_parity_asset(testing::parity_dir())).to_dtype(torch::kFloat64);
    const torch::Tensor axis_angle = torch::cat({exact("smal_global_orient"), exact("smal_pose")}, 1);
    const torch::Tensor rotations =
        smal::tensors::axis_angle_to_matrix_exact(axis_angle.reshape({axis_angle.size(0), -1, 3}));
    return body.forward(rotations, exact("smal_betas"), exact("smal_transl")).vertices;
  }
  static torch::Tensor predicted_vertices() {
    return golden("pred_vertices_i16").to(torch::kFloat64) * std::ldexp(1.0, -11);
  }
  // `predicted` and `truth` (V, 3).
  static double pa_mpvpe(const torch::Tensor& predicted, const torch::Tensor& truth) {
    const torch::Tensor from = predicted.to(torch::kFloat32).contiguous();
    const torch::Tensor to = truth.to(torch::kFloat32).contiguous();
    return procrustes_error_mm(view(from), view(to));
  }

  static inline smal::tensors::SafeTensors* file_ = nullptr;
  static inline std::vector<std::string> cases_;
};

TEST_F(MetricsParity, Pck) {
  ASSERT_EQ(cases_.size(), static_cast<std::size_t>(golden("pck").size(0)));
  for (std::size_t i = 0; i < cases_.size(); ++i) {
    const torch::Tensor expected = golden("pck", i);
    expect_pck(i, normaliser_px(i), 0.10, expected[0].item<double>());
    expect_pck(i, normaliser_px(i), 0.15, expected[1].item<double>());
  }
}

TEST_F(MetricsParity, PckCurve) {
  for (std::size_t i = 0; i < cases_.size(); ++i) {
    const torch::Tensor expected = golden("pck_curve", i);
    const std::int64_t count = expected.size(0);
    for (std::int64_t t = 0; t < count; ++t) {
      const double threshold = static_cast<double>(t) / static_cast<double>(count - 1);
      expect_pck(i, normaliser_px(i), threshold, expected[t].item<double>());
    }
  }
}

TEST_F(MetricsParity, Auc) {
  for (std::size_t i = 0; i < cases_.size(); ++i) expect_auc(i, normaliser_px(i), number("auc", i));
}

TEST_F(MetricsParity, WithoutAMaskTheWholeCropNormalises) {
  const torch::Tensor expected = golden("nomask_pck_case0");
  expect_pck(0, kFullCropPx, 0.10, expected[0].item<double>());
  expect_pck(0, kFullCropPx, 0.15, expected[1].item<double>());
  expect_auc(0, kFullCropPx, number("nomask_auc_case0", 0));
}

TEST_F(MetricsParity, ProcrustesAlignedKeypoints) {
  for (std::size_t i = 0; i < cases_.size(); ++i) {
    const auto aligned = procrustes_align(view(golden("pred_keypoints_3d", i)), view(true_keypoints_3d(i)));
    const torch::Tensor golden_points = golden("procrustes_joints", i);
    const auto expected = view(golden_points);
    const double tolerance = alignment_rounding(golden("pred_keypoints_3d", i), true_keypoints_3d(i));
    ASSERT_EQ(aligned.size(), expected.size());
    for (std::size_t k = 0; k < expected.size(); ++k) {
      EXPECT_NEAR(aligned[k], expected[k], tolerance) << cases_[i];
    }
  }
}

// For a perfect prediction, the official code finds its own rounding and we find 0.
TEST_F(MetricsParity, PaMpjpe) {
  for (std::size_t i = 0; i < cases_.size(); ++i) {
    const double tolerance = alignment_rounding(golden("pred_keypoints_3d", i), true_keypoints_3d(i));
    EXPECT_NEAR(pa_mpjpe(i), number("pa_mpjpe", i), kMmPerUnit * tolerance) << cases_[i];
    if (cases_[i] == "perfect") {
      EXPECT_LT(pa_mpjpe(i), 1e-9);
    }
  }
}

TEST_F(MetricsParity, PaMpvpe) {
  const torch::Tensor truth = true_vertices();
  const torch::Tensor predicted = predicted_vertices();
  const torch::Tensor sampled = truth.slice(1, 0, truth.size(1), 32);
  ASSERT_EQ(sampled.sizes(), golden("gt_vertices_every32").sizes());
  EXPECT_LE((sampled - golden("gt_vertices_every32")).abs().max().item<double>(),
            kBody * sampled.abs().max().item<double>());
  for (std::size_t i = 0; i < cases_.size(); ++i) {
    const auto row = static_cast<std::int64_t>(i);
    const double tolerance = alignment_rounding(predicted[row], truth[row]);
    EXPECT_NEAR(pa_mpvpe(predicted[row], truth[row]), number("pa_mpvpe", i), kMmPerUnit * tolerance)
        << cases_[i];
  }
}

// The evaluator's batch numbers are means over the samples, those without a visible keypoint included as 0.
TEST_F(MetricsParity, BatchMeans2d) {
  constexpr std::size_t kFirst = 7;
  const auto mean_pck = [&](double share, double threshold) {
    double sum = 0.0;
    for (std::size_t i = 0; i < kFirst; ++i) sum += official_pck(i, share * normaliser_px(i), threshold);
    return sum / kFirst;
  };
  const auto mean_auc = [&](double share) {
    double sum = 0.0;
    for (std::size_t i = 0; i < kFirst; ++i) sum += official_auc(i, share * normaliser_px(i));
    return sum / kFirst;
  };
  const torch::Tensor expected = golden("batch_pck_first7");
  expect_within_rounding([&](double share) { return mean_pck(share, 0.10); }, 1.0, expected[0].item<double>(),
                         "pck @0.10");
  expect_within_rounding([&](double share) { return mean_pck(share, 0.15); }, 1.0, expected[1].item<double>(),
                         "pck @0.15");
  expect_within_rounding(mean_auc, 1.0, number("batch_auc_first7", 0), "auc");
}

TEST_F(MetricsParity, BatchMeans3d) {
  const torch::Tensor truth = true_vertices();
  const torch::Tensor predicted = predicted_vertices();
  const auto count = static_cast<double>(cases_.size());
  double joints = 0.0, joints_tolerance = 0.0, vertices = 0.0, vertices_tolerance = 0.0;
  for (std::size_t i = 0; i < cases_.size(); ++i) {
    const auto row = static_cast<std::int64_t>(i);
    joints += pa_mpjpe(i) / count;
    joints_tolerance += alignment_rounding(golden("pred_keypoints_3d", i), true_keypoints_3d(i)) / count;
    vertices += pa_mpvpe(predicted[row], truth[row]) / count;
    vertices_tolerance += alignment_rounding(predicted[row], truth[row]) / count;
  }
  EXPECT_NEAR(joints, number("batch_pa_mpjpe", 0), kMmPerUnit * joints_tolerance);
  EXPECT_NEAR(vertices, number("batch_pa_mpvpe", 0), kMmPerUnit * vertices_tolerance);
}

TEST_F(MetricsParity, OnlyASampleWithoutVisibleKeypointsHasNoValue) {
  for (std::size_t i = 0; i < cases_.size(); ++i) {
    const auto value = pck(projected(i), annotated(i), normaliser_px(i), 0.1);
    EXPECT_EQ(value.has_value(), cases_[i] != "zerovis") << cases_[i];
  }
}

}  // namespace
}  // namespace q3d::filters
