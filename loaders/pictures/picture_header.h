// Reads what a picture's header says of it, without decoding the pixels.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>

namespace q3d::loaders::pictures {

struct PictureHeader {
  int width_px = 0;  // width of the pixels as stored
  int height_px = 0;
  int orientation = 1;  // EXIF orientation, 1 to 8; 1 (as stored) if it is absent or damaged
};

// Reads the size and the EXIF orientation of a JPEG (APP1) or a PNG (eXIf). Returns nothing if the content is
// neither, or if its header is damaged or cut short. The file is read in small pieces up to its pixels.
// Throws manifests::IoError if the file exists and cannot be read; a file that does not exist has no header.
std::optional<PictureHeader> read_picture_header(const std::filesystem::path& path);
std::optional<PictureHeader> read_picture_header(std::span<const std::byte> content);

}  // namespace q3d::loaders::pictures
