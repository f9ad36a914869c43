// JPEG decoding through libjpeg. OpenCV's reader has no way to tell that a picture ends too early (it fills
// the rest with grey) and lets libjpeg print its warnings.
#pragma once

#include <cstddef>
#include <span>

#include "loaders/pictures/image.h"

namespace q3d::loaders::pictures {

bool is_jpeg(std::span<const std::byte> bytes);

// 8-bit RGB. A picture whose data or end marker is missing is image_truncated; harmless oddities that libjpeg
// warns about (stray bytes between markers) are let pass, as PIL does.
DecodedImage decode_jpeg(std::span<const std::byte> bytes);

}  // namespace q3d::loaders::pictures
