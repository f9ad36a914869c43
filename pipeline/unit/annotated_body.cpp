#include "pipeline/unit/annotated_body.h"

#include <cmath>
#include <limits>

#include "smal/axis_angle.h"

namespace q3d::pipeline::unit {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

bool is_before_camera(const manifests::BodyTruth& truth) {
  for (std::size_t k = 0; k < manifests::kNumKeypoints; ++k) {
    if (!(truth.keypoints_3d[3 * k + 2] + truth.trans[2] >= kNearestDepth)) return false;
  }
  return true;
}

void project(device::BodyPrediction& body) {
  for (std::size_t k = 0; k < manifests::kNumKeypoints; ++k) {
    const double depth = double{body.keypoints_3d[3 * k + 2]} + body.translation[2];
    const auto on_axis = [&](std::size_t axis) {
      const double point = double{body.keypoints_3d[3 * k + axis]} + body.translation[axis];
      return static_cast<float>(smal::kFocalInCropUnits * point / depth);
    };
    body.keypoints_2d[k] = {on_axis(0), on_axis(1)};
  }
}

}  // namespace

device::BodyPrediction no_body() {
  device::BodyPrediction body;
  body.camera = {kNaN, kNaN, kNaN};
  body.keypoints_2d.fill({kNaN, kNaN});
  return body;
}

device::BodyPrediction annotated_body(const manifests::BodyTruth& truth) {
  device::BodyPrediction body = no_body();
  body.pose = smal::rotation_matrices(truth.pose_axis_angle);
  body.betas = truth.betas;
  body.translation = truth.trans;
  body.keypoints_3d = truth.keypoints_3d;
  if (truth.trans[2] < kNearestDepth) return body;
  body.camera = {static_cast<float>(2.0 * smal::kFocalPx / (double{smal::kCropSidePx} * truth.trans[2])),
                 truth.trans[0], truth.trans[1]};
  if (truth.has_keypoints_3d && is_before_camera(truth)) project(body);
  return body;
}

bool has_projection(const smal::CropPoints& keypoints_2d) {
  return !std::isnan(keypoints_2d[0].x);
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

}  // namespace q3d::pipeline::unit
