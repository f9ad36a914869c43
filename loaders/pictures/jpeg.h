// Decodes JPEG with libjpeg. OpenCV's reader cannot tell that a picture ends too early (it fills the rest
// with grey), and it lets libjpeg print its warnings.
#pragma once

#include <cstddef>
#include <span>

#include "loaders/pictures/image.h"

namespace q3d::loaders::pictures {

bool is_jpeg(std::span<const std::byte> bytes);

// Decodes to 8-bit RGB. A picture whose data or end marker is missing fails as image_truncated. Harmless
// oddities that libjpeg warns about (stray bytes between markers) are accepted, as PIL does. Throws
// std::bad_alloc, or cv::Exception with StsNoMem, if memory runs out.
DecodedImage decode_jpeg(std::span<const std::byte> bytes);

}  // namespace q3d::loaders::pictures
