// PNG decoding through OpenCV, after the file's own structure and checksums have been checked.
#pragma once

#include <cstddef>
#include <span>

#include "loaders/pictures/image.h"

namespace q3d::loaders::pictures {

bool is_png(std::span<const std::byte> bytes);

// 8-bit RGB. Chunks that do not hold pixels (colour profiles, EXIF, text) are left out before OpenCV sees the
// file: they change no pixel here, and libpng prints its opinion of them. (A file forged so that its
// checksums fit its damage still fails, but libpng has its say on stderr.)
DecodedImage decode_png(std::span<const std::byte> bytes);

}  // namespace q3d::loaders::pictures
