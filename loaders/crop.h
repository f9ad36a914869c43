// The network's crop, bit-exact with the official code (OpenCV 4.x), and the larger crop that shards store.
#pragma once

#include <opencv2/core.hpp>

#include <array>

#include "manifests/sample.h"

namespace q3d::loaders {

inline constexpr int kPatchSidePx = 256;

struct SquareBox {  // pixels of the source image
  double center_x_px = 0.0;
  double center_y_px = 0.0;
  double side_px = 0.0;
};

// Official Train/EvaluationDataset: centre (2x + w) // 2, (2y + h) // 2 (floor), side max(w, h), at least 1.
SquareBox square_box(const manifests::Box& box);

// 2x3 affine, row-major, image px -> patch px. Official code: gen_trans_from_patch_cv (rotation in degrees).
std::array<double, 6> patch_from_image(const SquareBox& box, int patch_side_px, double scale = 1.0,
                                       double rotation_deg = 0.0);

struct Patch {
  cv::Mat rgb;  // 8-bit, 3 channels, kPatchSidePx square
  cv::Mat
      mask;  // 8-bit, 1 channel, 0 or the warped silhouette; all 255 when there is none or it is all < 0.5
  bool has_mask = false;
  std::array<double, 6> from_image{};
};

// Official code: get_example / generate_image_patch_cv2 without augmentation.
Patch make_patch(const cv::Mat& rgb, const cv::Mat& mask, const SquareBox& box);

// Keypoints of the source image -> crop units: affine in double, stored as float32 px, / 256 - 0.5 in
// float32. Returns 26 x (x, y, weight).
std::array<float, manifests::kNumKeypoints * 3> keypoints_to_crop(
    const manifests::Keypoints& keypoints, const std::array<double, 6>& patch_from_image);

struct StoredCrop {
  cv::Mat rgb;
  cv::Mat mask;  // empty when there is none
  int side_px = 0;
  std::array<double, 6> from_image{};
};
// Covers `scale` times the box, at min_side_px or more unless the source has fewer pixels there.
StoredCrop make_stored_crop(const cv::Mat& rgb, const cv::Mat& mask, const SquareBox& box, double scale,
                            int min_side_px);

}  // namespace q3d::loaders
