#include "loaders/pictures/demo_crop.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "loaders/pictures/crop.h"

namespace q3d::loaders::pictures {
namespace {

// Blurs like skimage.filters.gaussian: in double precision, with the kernel cut at four sigma and edges
// repeated.
cv::Mat blurred(const cv::Mat& rgb, double sigma) {
  const int radius = static_cast<int>(4.0 * sigma + 0.5);
  cv::Mat kernel(2 * radius + 1, 1, CV_64F);
  for (int i = -radius; i <= radius; ++i)
    kernel.at<double>(i + radius) = std::exp(-0.5 * i * i / (sigma * sigma));
  kernel /= cv::sum(kernel)[0];
  cv::Mat result;
  cv::sepFilter2D(rgb, result, CV_64F, kernel, kernel, {-1, -1}, 0.0, cv::BORDER_REPLICATE);
  return result;
}

// Returns the longer side after a box of w x h px was widened to the aspect. Official code:
// expand_to_aspect_ratio.
float longer_side(float w, float h, const std::array<int, 2>& aspect) {
  if (aspect[0] <= 0 || aspect[1] <= 0) return std::max(w, h);
  const double ratio = static_cast<double>(aspect[1]) / aspect[0];
  if (static_cast<double>(h) / w < ratio) return static_cast<float>(std::max(w * ratio, 1.0 * w));
  return static_cast<float>(std::max(h / ratio, 1.0 * h));
}

std::vector<float> normalised(const cv::Mat& patch) {  // float32 RGB, 0..255
  std::vector<float> planes;
  planes.reserve(3 * patch.total());
  for (int c = 0; c < 3; ++c) {
    const auto mean = static_cast<float>(255.0 * kImageMean[static_cast<std::size_t>(c)]);
    const auto spread = static_cast<float>(255.0 * kImageStd[static_cast<std::size_t>(c)]);
    for (const auto& pixel : cv::Mat_<cv::Vec3f>(patch)) planes.push_back((pixel[c] - mean) / spread);
  }
  return planes;
}

}  // namespace

DemoCrop demo_crop(const cv::Mat& rgb, const std::array<float, 4>& box_xyxy,
                   const std::array<int, 2>& aspect) {
  const float w = (box_xyxy[2] - box_xyxy[0]) / 200.0F * 200.0F;
  const float h = (box_xyxy[3] - box_xyxy[1]) / 200.0F * 200.0F;
  if (rgb.type() != CV_8UC3 || rgb.empty() || !(w > 0.0F) || !(h > 0.0F)) {
    throw std::invalid_argument(fmt::format(
        "demo_crop: got a {}x{} picture of type {} and a box of {} x {} px, expected 8-bit RGB and "
        "a box with area",
        rgb.cols, rgb.rows, rgb.type(), w, h));
  }
  DemoCrop crop;
  crop.center_x_px = (box_xyxy[2] + box_xyxy[0]) / 2.0F;
  crop.center_y_px = (box_xyxy[3] + box_xyxy[1]) / 2.0F;
  crop.side_px = longer_side(w, h, aspect);

  const Affine affine = patch_from_image({crop.center_x_px, crop.center_y_px, crop.side_px}, kPatchSidePx);
  const double shrink = static_cast<double>(crop.side_px) / kPatchSidePx / 2.0;
  const cv::Mat source = shrink > 1.1 ? blurred(rgb, (shrink - 1.0) / 2.0) : rgb;
  cv::Mat patch;
  cv::warpAffine(source, patch, cv::Matx23d(affine.data()), {kPatchSidePx, kPatchSidePx}, cv::INTER_LINEAR,
                 cv::BORDER_CONSTANT, cv::Scalar::all(0));
  patch.convertTo(patch, CV_32FC3);
  crop.planes = normalised(patch);
  return crop;
}

}  // namespace q3d::loaders::pictures
