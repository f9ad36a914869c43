#include "loaders/pictures/crop.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace q3d::loaders::pictures {
namespace {

double floored_centre(double start, double extent) {
  return std::floor((start * 2.0 + extent) / 2.0);
}

// The official rotate_2d: the offset is float32, sine and cosine are double, the result is float32 again.
cv::Point2f rotated(float x, float y, double angle_rad) {
  const double sine = std::sin(angle_rad);
  const double cosine = std::cos(angle_rad);
  return {static_cast<float>(x * cosine - y * sine), static_cast<float>(x * sine + y * cosine)};
}

void require_picture(const cv::Mat& picture, int type, cv::Size size, const char* what) {
  if (picture.empty() || picture.type() != type || (size.width > 0 && picture.size() != size)) {
    throw std::invalid_argument(
        fmt::format("warp_patch: {}: got {}x{} with type {}, expected {}x{} with type {}", what, picture.cols,
                    picture.rows, picture.type(), size.width > 0 ? size.width : picture.cols,
                    size.height > 0 ? size.height : picture.rows, type));
  }
}

cv::Mat warp(const cv::Mat& source, const Affine& from_source, int border_mode) {
  const cv::Matx23d matrix(from_source.data());
  cv::Mat warped;
  cv::warpAffine(source, warped, matrix, {kPatchSidePx, kPatchSidePx}, cv::INTER_LINEAR, border_mode,
                 cv::Scalar::all(0));
  return warped;
}

// Official rule: the mask is used when any of its pixels / 255 reaches one half.
bool reaches_half(const cv::Mat& mask) {
  double most = 0.0;
  cv::minMaxLoc(mask, nullptr, &most);
  return most / 255.0 >= 0.5;
}

}  // namespace

SquareBox square_box(const manifests::Box& box) {
  return {floored_centre(box.x_px, box.w_px), floored_centre(box.y_px, box.h_px),
          std::max({box.w_px, box.h_px, 1.0})};
}

SquareBox evaluation_box(const manifests::Box& box) {
  SquareBox square = square_box(box);
  const auto through_float = [](double side) { return static_cast<float>(side) / 200.0F * 200.0F; };
  square.side_px = std::max({through_float(box.w_px), through_float(box.h_px), 1.0F});
  return square;
}

Affine patch_from_image(const SquareBox& box, int patch_side_px, double scale, double rotation_deg) {
  const double angle_rad = std::numbers::pi * rotation_deg / 180.0;
  const auto half_source = static_cast<float>(box.side_px * scale * 0.5);
  const auto half_patch = static_cast<float>(patch_side_px * 0.5);
  const cv::Point2f down = rotated(0.0F, half_source, angle_rad);
  const cv::Point2f right = rotated(half_source, 0.0F, angle_rad);
  // Take three points (centre, below it, right of it) of the image and of the patch, rounded to float32.
  const auto image_point = [&](const cv::Point2f& offset) {
    return cv::Point2f(static_cast<float>(box.center_x_px + offset.x),
                       static_cast<float>(box.center_y_px + offset.y));
  };
  const std::array<cv::Point2f, 3> source{image_point({0.0F, 0.0F}), image_point(down), image_point(right)};
  const std::array<cv::Point2f, 3> target{cv::Point2f(half_patch, half_patch),
                                          cv::Point2f(half_patch, half_patch + half_patch),
                                          cv::Point2f(half_patch + half_patch, half_patch)};
  const cv::Mat solved = cv::getAffineTransform(source.data(), target.data());
  Affine affine{};
  std::copy_n(solved.ptr<double>(), affine.size(), affine.begin());
  return affine;
}

Patch warp_patch(const cv::Mat& rgb, const cv::Mat& mask, const Affine& from_image, Border border) {
  require_picture(rgb, CV_8UC3, {}, "picture");
  if (!mask.empty()) require_picture(mask, CV_8UC1, rgb.size(), "mask");
  Patch patch;
  patch.from_image = from_image;
  patch.rgb = warp(rgb, from_image, border == Border::constant ? cv::BORDER_CONSTANT : cv::BORDER_REPLICATE);
  if (!mask.empty()) patch.mask = warp(mask, from_image, cv::BORDER_CONSTANT);
  patch.has_mask = !mask.empty() && reaches_half(patch.mask);
  if (!patch.has_mask) patch.mask = cv::Mat(kPatchSidePx, kPatchSidePx, CV_8UC1, cv::Scalar(255));
  return patch;
}

Patch make_patch(const cv::Mat& rgb, const cv::Mat& mask, const SquareBox& box) {
  return warp_patch(rgb, mask, patch_from_image(box, kPatchSidePx));
}

cv::Mat border_mask(const cv::Mat& patch_rgb) {
  cv::Mat black;
  cv::inRange(patch_rgb, cv::Scalar::all(0), cv::Scalar::all(0), black);
  return ~black;
}

void normalise_patch(const cv::Mat& patch_rgb, const std::array<double, 3>& colour_scale,
                     std::span<float> planes) {
  const auto plane_size = static_cast<std::size_t>(patch_rgb.total());
  if (patch_rgb.type() != CV_8UC3 || planes.size() != 3 * plane_size) {
    throw std::invalid_argument(
        fmt::format("normalise_patch: got room for {} numbers, expected {}", planes.size(), 3 * plane_size));
  }
  // A channel has 256 possible values, so each is computed once.
  std::array<std::array<float, 256>, 3> table{};
  for (std::size_t c = 0; c < 3; ++c) {
    const auto mean = static_cast<float>(255.0 * kImageMean[c]);
    const auto spread = static_cast<float>(255.0 * kImageStd[c]);
    for (std::size_t value = 0; value < 256; ++value) {
      const float scaled = static_cast<float>(value) * static_cast<float>(colour_scale[c]);
      table[c][value] = (std::clamp(scaled, 0.0F, 255.0F) - mean) / spread;
    }
  }
  std::size_t at = 0;
  for (int y = 0; y < patch_rgb.rows; ++y) {
    const auto* row = patch_rgb.ptr<cv::Vec3b>(y);
    for (int x = 0; x < patch_rgb.cols; ++x, ++at) {
      for (int c = 0; c < 3; ++c) {
        const auto channel = static_cast<std::size_t>(c);
        planes[channel * plane_size + at] = table[channel][row[x][c]];
      }
    }
  }
}

smal::CropKeypoints keypoints_to_crop(const manifests::Keypoints& keypoints, const Affine& patch_from_image) {
  constexpr auto kSide = static_cast<float>(kPatchSidePx);
  smal::CropKeypoints crop{};
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    // The official code holds annotated pixels in float32 before it applies the affine map in double.
    const Point image_px{static_cast<float>(keypoints[i].x_px), static_cast<float>(keypoints[i].y_px)};
    const Point patch_px = map_point(patch_from_image, image_px);
    crop[i] = {static_cast<float>(patch_px.x) / kSide - 0.5F, static_cast<float>(patch_px.y) / kSide - 0.5F,
               keypoints[i].weight};
  }
  return crop;
}

}  // namespace q3d::loaders::pictures
