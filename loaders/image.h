// Pictures from disk, decoded by content, never rotated by EXIF.
#pragma once

#include <opencv2/core.hpp>

#include <filesystem>
#include <string>

#include "manifests/sample.h"

namespace q3d::loaders {

struct DecodedImage {
  cv::Mat rgb;  // 8-bit, 3 channels, RGB; empty when it failed
  manifests::Reason failure = manifests::Reason::none;
  std::string detail;  // for people: what was found
};

// Grey, palette, alpha, 16-bit and CMYK pictures become 8-bit RGB as PIL's convert('RGB') does (alpha
// dropped). Never throws for a bad picture.
DecodedImage decode_image(const std::filesystem::path& path);

// 8-bit single-channel mask as PIL's convert('L'); an absent path gives an empty Mat without failure.
DecodedImage decode_mask(const std::filesystem::path& path);

}  // namespace q3d::loaders
