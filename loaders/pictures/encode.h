// Encodes pictures, for the crops that shards store. Equal pixels give equal bytes.
#pragma once

#include <opencv2/core.hpp>

#include <cstddef>
#include <span>
#include <vector>

#include "loaders/pictures/affine.h"

namespace q3d::loaders::pictures {

// Encodes 8-bit RGB as JPEG, 4:2:0, quality 1..100. Throws std::runtime_error if OpenCV cannot encode it.
std::vector<std::byte> encode_jpeg(const cv::Mat& rgb, int quality);

// Encodes 8-bit RGB or a single channel as PNG.
std::vector<std::byte> encode_png(const cv::Mat& picture);

// Decodes a picture that encode_* made to 8-bit RGB (`channels` 3) or one channel (1). Throws
// std::runtime_error if the bytes are not a picture.
cv::Mat decode_stored(std::span<const std::byte> bytes, int channels);

// Pixels of a stored crop, and where the first of them lies in it.
struct StoredRegion {
  cv::Mat rgb;
  cv::Point origin;
};

// Decodes the part of a stored RGB crop that warp_patch needs for this map from crop px to patch px, or more.
// A JPEG is decoded only that far, which saves most of the time, because a crop's side is 1.9 times the
// box's. Throws as decode_stored does.
StoredRegion decode_stored_for(std::span<const std::byte> bytes, const Affine& patch_from_crop);

}  // namespace q3d::loaders::pictures
