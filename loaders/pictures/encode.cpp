#include "loaders/pictures/encode.h"

#include <fmt/format.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "loaders/pictures/crop.h"
#include "loaders/pictures/jpeg.h"

namespace q3d::loaders::pictures {
namespace {

std::vector<std::byte> encode(const cv::Mat& picture, const char* extension,
                              const std::vector<int>& parameters) {
  cv::Mat bgr;  // needs memory of its own: cvtColor in place would change the caller's pixels
  if (picture.channels() == 3) {
    cv::cvtColor(picture, bgr, cv::COLOR_RGB2BGR);
  } else {
    bgr = picture;
  }
  std::vector<std::uint8_t> bytes;
  if (bgr.empty() || !cv::imencode(extension, bgr, bytes, parameters)) {
    throw std::runtime_error(fmt::format("cannot encode a {} x {} picture with {} channels as {}",
                                         picture.cols, picture.rows, picture.channels(), extension));
  }
  const auto view = std::as_bytes(std::span(bytes));
  return {view.begin(), view.end()};
}

// Returns the region of source pixels that the patch covers, with the neighbours that the interpolation
// reads.
cv::Rect source_of_patch(const Affine& patch_from_crop) {
  constexpr double kLast = kPatchSidePx - 1.0;
  constexpr int kNeighboursPx = 2;
  const Affine crop_from_patch = invert(patch_from_crop);
  double left = 1e9, top = 1e9, right = -1e9, bottom = -1e9;
  for (const Point corner : {Point{0, 0}, Point{kLast, 0}, Point{0, kLast}, Point{kLast, kLast}}) {
    const Point at = map_point(crop_from_patch, corner);
    left = std::min(left, at.x), right = std::max(right, at.x);
    top = std::min(top, at.y), bottom = std::max(bottom, at.y);
  }
  const auto pixel = [](double at) { return static_cast<int>(std::floor(std::clamp(at, -1e6, 1e6))); };
  const cv::Point first(pixel(left) - kNeighboursPx, pixel(top) - kNeighboursPx);
  const cv::Point beyond(pixel(right) + kNeighboursPx + 1, pixel(bottom) + kNeighboursPx + 1);
  return {first, beyond};
}

std::runtime_error no_picture(std::span<const std::byte> bytes) {
  return std::runtime_error(
      fmt::format("the stored crop ({} bytes) does not decode as a picture", bytes.size()));
}

}  // namespace

std::vector<std::byte> encode_jpeg(const cv::Mat& rgb, int quality) {
  return encode(rgb, ".jpg", {cv::IMWRITE_JPEG_QUALITY, quality});
}

std::vector<std::byte> encode_png(const cv::Mat& picture) {
  return encode(picture, ".png", {cv::IMWRITE_PNG_COMPRESSION, 3});
}

cv::Mat decode_stored(std::span<const std::byte> bytes, int channels) {
  const cv::Mat buffer(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<std::byte*>(bytes.data()));
  cv::Mat picture;
  if (!bytes.empty()) picture = cv::imdecode(buffer, channels == 1 ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR);
  if (picture.empty()) throw no_picture(bytes);
  if (channels == 3) cv::cvtColor(picture, picture, cv::COLOR_BGR2RGB);
  return picture;
}

StoredRegion decode_stored_for(std::span<const std::byte> bytes, const Affine& patch_from_crop) {
  if (!is_jpeg(bytes)) return {decode_stored(bytes, 3), {}};
  DecodedRegion region = decode_jpeg_region(bytes, source_of_patch(patch_from_crop));
  if (region.image.failure != manifests::Reason::none) throw no_picture(bytes);
  return {region.image.rgb, region.origin};
}

}  // namespace q3d::loaders::pictures
