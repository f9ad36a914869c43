#include "pipeline/annotated_body.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "loaders/crop.h"

namespace q3d::pipeline {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr double kFocalPx = 1000.0;  // of the 256-px crop; smal/camera.h has it too, beside LibTorch
constexpr double kSidePx = loaders::kPatchSidePx;

Eigen::Matrix3d rotation_matrix(const Eigen::Vector3d& axis_angle) {
  const double angle_rad = axis_angle.norm();
  if (angle_rad == 0.0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle_rad, axis_angle / angle_rad).toRotationMatrix();
}

bool is_before_camera(const manifests::BodyTruth& truth) {
  for (std::size_t k = 0; k < manifests::kNumKeypoints; ++k) {
    if (!(truth.keypoints_3d[3 * k + 2] + truth.trans[2] >= kNearestDepth)) return false;
  }
  return true;
}

void project(BodyPrediction& body) {
  for (std::size_t k = 0; k < manifests::kNumKeypoints; ++k) {
    const double depth = double{body.keypoints_3d[3 * k + 2]} + body.translation[2];
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const double point = double{body.keypoints_3d[3 * k + axis]} + body.translation[axis];
      body.keypoints_2d[2 * k + axis] = static_cast<float>(kFocalPx / kSidePx * point / depth);
    }
  }
}

}  // namespace

BodyPrediction no_body() {
  BodyPrediction body;
  body.camera.fill(kNaN);
  body.keypoints_2d.fill(kNaN);
  return body;
}

BodyPrediction annotated_body(const manifests::BodyTruth& truth) {
  BodyPrediction body = no_body();
  for (std::size_t joint = 0; joint < manifests::kNumJoints; ++joint) {
    const float* turn = &truth.pose_axis_angle[3 * joint];
    const Eigen::Matrix<float, 3, 3, Eigen::RowMajor> matrix =
        rotation_matrix({turn[0], turn[1], turn[2]}).cast<float>();
    std::copy_n(matrix.data(), 9, &body.rotations[9 * joint]);
  }
  body.betas = truth.betas;
  body.translation = truth.trans;
  body.keypoints_3d = truth.keypoints_3d;
  if (truth.trans[2] < kNearestDepth) return body;
  body.camera = {static_cast<float>(2.0 * kFocalPx / (kSidePx * truth.trans[2])), truth.trans[0],
                 truth.trans[1]};
  if (truth.has_keypoints_3d && is_before_camera(truth)) project(body);
  return body;
}

bool has_projection(const std::array<float, manifests::kNumKeypoints * 2>& keypoints_2d) {
  return !std::isnan(keypoints_2d[0]);
}

std::string missing_parts(const manifests::BodyTruth& truth) {
  std::string text;
  const auto add = [&text](bool is_missing, const char* what) {
    if (is_missing) text += (text.empty() ? "the file gives no " : ", no ") + std::string(what);
  };
  add(!truth.has_betas, "shape");
  add(!truth.has_keypoints_3d, "keypoint_3d");
  add(truth.trans[2] < kNearestDepth || (truth.has_keypoints_3d && !is_before_camera(truth)),
      "trans that puts the body before the camera");
  return text;
}

}  // namespace q3d::pipeline
