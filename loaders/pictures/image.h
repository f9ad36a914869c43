// Reads pictures from disk. They are decoded by content, never by file name, and never rotated by EXIF,
// because annotations refer to the pixels as stored.
//
// JPEG and PNG are read, which are the formats of the datasets. Any other content is a failure that names
// what was found. No picture larger than kMaxPixels is allocated, whatever its header says.
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

// Reads a whole file, so that a caller can digest the very bytes that it decodes. A file that is missing, too
// large or not a regular file is a failure. Throws manifests::IoError if a file exists and cannot be read:
// such an error (EIO, ESTALE, EMFILE, EACCES, ...) says nothing about the picture.
FileBytes read_picture_file(const std::filesystem::path& path);

struct DecodedImage {
  cv::Mat rgb;  // 8-bit, 3 channels, RGB; empty when it failed
  manifests::Reason failure = manifests::Reason::none;
  std::string detail;
  std::string sha256{};  // of the file whose bytes were decoded; empty if no file was read
};

// Decodes a picture. Grey, palette, alpha, 16-bit and CMYK pictures become 8-bit RGB as with PIL's
// convert('RGB'): alpha is dropped, and CMYK is read as Adobe's inverted kind. There is one difference: of
// 16-bit grey the high byte is kept, where PIL clips at 255 and gives a white picture. A bad picture is a
// failure and never throws. Throws std::bad_alloc if memory runs out. The overload that takes a path also
// throws as read_picture_file does.
DecodedImage decode_image(std::span<const std::byte> bytes);
DecodedImage decode_image(const std::filesystem::path& path);

// The kind of content of a mask file. The official code takes every file for a silhouette, but some
// converters name the picture itself as its mask, or write 0 and 1.
enum class MaskKind : std::uint8_t {
  absent,      // no mask is named
  silhouette,  // has dark and bright pixels, as a mask should
  low_valued,  // has 0 and one other value below 128; it is scaled to 0 and 255
  blank,       // is 0 everywhere: it shows no animal
  picture,     // has mid-tones: it is a photograph, not a mask
};

struct DecodedMask {
  cv::Mat silhouette;  // 8-bit, 1 channel, 255 = animal; empty unless kind is silhouette or low_valued
  MaskKind kind = MaskKind::absent;
  manifests::Reason failure = manifests::Reason::none;
  std::string detail;
  std::string sha256{};  // of the file whose bytes were decoded; empty if no file was read
};

// Decodes a mask. Grey values are those of PIL's convert('L'). An empty path is an absent mask; a path that
// names no file is a failure. Throws as decode_image does.
DecodedMask decode_mask(std::span<const std::byte> bytes);
DecodedMask decode_mask(const std::filesystem::path& path);

}  // namespace q3d::loaders::pictures
