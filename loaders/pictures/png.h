// Decodes PNG with OpenCV, after checking the file's structure and checksums.
#pragma once

#include <cstddef>
#include <span>

#include "loaders/pictures/image.h"

namespace q3d::loaders::pictures {

bool is_png(std::span<const std::byte> bytes);

// Decodes to 8-bit RGB. Chunks that hold no pixels (colour profiles, EXIF, text) are removed before OpenCV
// sees the file: they do not change pixels here, and libpng prints warnings about them. (If a file was forged
// so that its checksums fit the damage, it still fails, but libpng prints to stderr.)
DecodedImage decode_png(std::span<const std::byte> bytes);

}  // namespace q3d::loaders::pictures
