#include "loaders/pictures/encode.h"

#include <fmt/format.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <stdexcept>

namespace q3d::loaders::pictures {
namespace {

std::vector<std::byte> encode(const cv::Mat& picture, const char* extension,
                              const std::vector<int>& parameters) {
  cv::Mat bgr;  // not a second header of `picture`: cvtColor would turn the caller's pixels
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
  if (picture.empty()) {
    throw std::runtime_error(
        fmt::format("the stored crop ({} bytes) does not decode as a picture", bytes.size()));
  }
  if (channels == 3) cv::cvtColor(picture, picture, cv::COLOR_BGR2RGB);
  return picture;
}

}  // namespace q3d::loaders::pictures
