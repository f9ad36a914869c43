// Decodes JPEG with libjpeg. OpenCV's reader cannot tell that a picture ends too early (it fills the rest
// with grey), and it lets libjpeg print its warnings.
#pragma once

#include <cstddef>
#include <opencv2/core.hpp>
#include <span>

#include "loaders/pictures/image.h"

namespace q3d::loaders::pictures {

bool is_jpeg(std::span<const std::byte> bytes);

// Decodes to 8-bit RGB. A picture whose data or end marker is missing fails as image_truncated. Harmless
// oddities that libjpeg warns about (stray bytes between markers) are accepted, as PIL does. Throws
// std::bad_alloc, or cv::Exception with StsNoMem, if memory runs out.
DecodedImage decode_jpeg(std::span<const std::byte> bytes);

// A part of a picture and the position of its first pixel in the picture.
struct DecodedRegion {
  DecodedImage image;
  cv::Point origin;
};

// Decodes a part that covers `wanted` as far as it lies inside the picture, and at least one pixel. Within
// this part, the pixels are those of decode_jpeg. Only the compressed data up to its last row are read, so
// that a picture that ends later than that is not noticed. Throws as decode_jpeg does.
DecodedRegion decode_jpeg_region(std::span<const std::byte> bytes, const cv::Rect& wanted);

}  // namespace q3d::loaders::pictures
