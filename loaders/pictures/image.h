// Pictures from disk, decoded by content (never by file name) and never rotated by EXIF: annotations are in
// the pixels as stored.
//
// JPEG and PNG are read, which is what the datasets hold; any other content is a failure that names what was
// found. No picture is allocated beyond kMaxPixels, whatever its header says.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <vector>

#include "manifests/sample.h"

namespace q3d::loaders::pictures {

inline constexpr std::int64_t kMaxPixels = 200'000'000;
inline constexpr std::uintmax_t kMaxFileBytes = 512U << 20U;

struct FileBytes {
  std::vector<std::byte> bytes;  // empty when it failed
  manifests::Reason failure = manifests::Reason::none;
  std::string detail;  // for people: what was found
};

// A whole file, so that a caller can digest the very bytes that it decodes. Never throws for a bad file.
FileBytes read_picture_file(const std::filesystem::path& path);

struct DecodedImage {
  cv::Mat rgb;  // 8-bit, 3 channels, RGB; empty when it failed
  manifests::Reason failure = manifests::Reason::none;
  std::string detail;
};

// Grey, palette, alpha, 16-bit and CMYK pictures become 8-bit RGB as PIL's convert('RGB') does: alpha is
// dropped, CMYK is taken as Adobe's inverted kind. One difference: of 16-bit grey the high byte is kept,
// where PIL clips at 255 and gives a white picture. Never throws for a bad picture.
DecodedImage decode_image(std::span<const std::byte> bytes);
DecodedImage decode_image(const std::filesystem::path& path);

// What a mask file turned out to be. The official code takes every file for a silhouette; converters exist
// that name the picture itself as its mask, or write 0 and 1.
enum class MaskKind : std::uint8_t {
  absent,      // no mask is named
  silhouette,  // dark and bright, as it should be
  low_valued,  // 0 and one other value below 128: brought to 0 and 255
  blank,       // all 0: no animal in it
  picture,     // mid-tones: a photograph, not a mask
};

struct DecodedMask {
  cv::Mat silhouette;  // 8-bit, 1 channel, 255 = animal; empty unless kind is silhouette or low_valued
  MaskKind kind = MaskKind::absent;
  manifests::Reason failure = manifests::Reason::none;
  std::string detail;
};

// Grey as PIL's convert('L'). An empty path is an absent mask; a path that cannot be read is a failure.
DecodedMask decode_mask(std::span<const std::byte> bytes);
DecodedMask decode_mask(const std::filesystem::path& path);

}  // namespace q3d::loaders::pictures
