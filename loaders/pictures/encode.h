// Pictures to bytes, for the crops that shards store. Equal pixels give equal bytes.
#pragma once

#include <opencv2/core.hpp>

#include <cstddef>
#include <span>
#include <vector>

namespace q3d::loaders::pictures {

// 8-bit RGB -> JPEG, 4:2:0, quality 1..100. Throws std::runtime_error when OpenCV cannot encode it.
std::vector<std::byte> encode_jpeg(const cv::Mat& rgb, int quality);

// 8-bit RGB or single-channel -> PNG.
std::vector<std::byte> encode_png(const cv::Mat& picture);

// A picture that encode_* made -> 8-bit RGB (`channels` 3) or one channel (1). Throws std::runtime_error when
// the bytes are not a picture.
cv::Mat decode_stored(std::span<const std::byte> bytes, int channels);

}  // namespace q3d::loaders::pictures
