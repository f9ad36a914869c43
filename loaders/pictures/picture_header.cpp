#include "loaders/pictures/picture_header.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <string_view>
#include <vector>

#include "manifests/file_descriptor.h"

namespace q3d::loaders::pictures {
namespace {

using namespace std::string_view_literals;

// Fills `bytes` from position `at` on. Returns false if the file ends earlier.
using ReadAt = std::function<bool(std::uint64_t at, std::span<std::byte> bytes)>;

constexpr std::string_view kPngSignature = "\x89PNG\r\n\x1a\n"sv;
constexpr std::string_view kExif = "Exif\0\0"sv;
constexpr std::size_t kMaxExifBytes = 1U << 16U;

std::uint32_t big_endian(std::span<const std::byte> bytes) {
  std::uint32_t value = 0;
  for (const std::byte byte : bytes) value = value << 8U | std::to_integer<std::uint32_t>(byte);
  return value;
}

// The TIFF structure inside an EXIF block.
class Tiff {
 public:
  explicit Tiff(std::span<const std::byte> bytes) : bytes_(bytes) {}

  // Returns tag 0x0112 of the first directory if it is one of 1 to 8, else 1.
  int orientation() const {
    constexpr std::uint32_t kTag = 0x0112;
    constexpr std::uint32_t kShort = 3;
    constexpr std::size_t kEntryBytes = 12;
    if (bytes_.size() < 8 || !(has_order("II") || has_order("MM")) || number(2, 2) != 42) return 1;
    const std::size_t directory = number(4, 4);
    const std::size_t entries = number(directory, 2);
    for (std::size_t i = 0; i < entries; ++i) {
      const std::size_t entry = directory + 2 + i * kEntryBytes;
      if (entry + kEntryBytes > bytes_.size()) return 1;
      if (number(entry, 2) != kTag) continue;
      const std::uint32_t value = number(entry + 8, number(entry + 2, 2) == kShort ? 2 : 4);
      return value >= 1 && value <= 8 ? static_cast<int>(value) : 1;
    }
    return 1;
  }

 private:
  bool has_order(const char* letters) const { return std::memcmp(bytes_.data(), letters, 2) == 0; }

  // Returns 0 beyond the end.
  std::uint32_t number(std::size_t at, std::size_t size) const {
    if (at > bytes_.size() || size > bytes_.size() - at) return 0;
    std::vector<std::byte> digits(bytes_.begin() + static_cast<std::ptrdiff_t>(at),
                                  bytes_.begin() + static_cast<std::ptrdiff_t>(at + size));
    if (has_order("II")) std::reverse(digits.begin(), digits.end());
    return big_endian(digits);
  }

  std::span<const std::byte> bytes_;
};

std::optional<PictureHeader> with_size(PictureHeader header, std::uint32_t width, std::uint32_t height) {
  constexpr std::uint32_t kMax = std::numeric_limits<int>::max();
  if (width == 0 || height == 0 || width > kMax || height > kMax) return std::nullopt;
  header.width_px = static_cast<int>(width);
  header.height_px = static_cast<int>(height);
  return header;
}

// A picture of a camera has some dozens of markers before its frame. Bytes that fill count too: without a
// limit, a hostile file of nothing else would keep the program busy for hours.
constexpr int kMostMarkers = 100'000;

// Goes from marker to marker, up to the frame's own.
std::optional<PictureHeader> read_jpeg_header(const ReadAt& read_at) {
  PictureHeader header;
  bool has_exif = false;
  std::uint64_t at = 2;
  for (int step = 0; step < kMostMarkers; ++step) {
    std::array<std::byte, 4> marker{};
    if (!read_at(at, marker) || marker[0] != std::byte{0xff}) return std::nullopt;
    const auto kind = std::to_integer<unsigned>(marker[1]);
    if (kind == 0xff) {  // a fill byte
      ++at;
      continue;
    }
    // Markers that stand alone: TEM, the restarts and the start of the image.
    const bool has_no_length = kind == 0x01 || (kind >= 0xd0 && kind <= 0xd8);
    if (has_no_length) {
      at += 2;
      continue;
    }
    // The next marker is the end of the image or the start of a scan.
    const bool are_pixels_next = kind == 0xd9 || kind == 0xda;
    if (are_pixels_next) return std::nullopt;
    const std::uint32_t length = big_endian(std::span(marker).subspan(2));
    if (length < 2) return std::nullopt;
    // There are 13 kinds of frames. The gaps between their numbers are DHT, JPG and DAC.
    const bool is_frame = kind >= 0xc0 && kind <= 0xcf && kind != 0xc4 && kind != 0xc8 && kind != 0xcc;
    if (is_frame) {
      std::array<std::byte, 5> frame{};  // bits per sample, height, width
      if (!read_at(at + 4, frame)) return std::nullopt;
      return with_size(header, big_endian(std::span(frame).subspan(3, 2)),
                       big_endian(std::span(frame).subspan(1, 2)));
    }
    if (kind == 0xe1 && !has_exif && length - 2 > kExif.size()) {
      std::vector<std::byte> block(length - 2);
      if (!read_at(at + 4, block)) return std::nullopt;
      has_exif = std::memcmp(block.data(), kExif.data(), kExif.size()) == 0;
      if (has_exif) header.orientation = Tiff(std::span(block).subspan(kExif.size())).orientation();
    }
    at += 2 + length;
  }
  return std::nullopt;
}

// Walks through the chunks up to the pixels.
std::optional<PictureHeader> read_png_header(const ReadAt& read_at) {
  constexpr std::uint64_t kFrameBytes = 12;  // length, type and checksum
  std::optional<PictureHeader> header;
  for (std::uint64_t at = kPngSignature.size();;) {
    std::array<std::byte, 8> start{};
    if (!read_at(at, start)) return std::nullopt;
    const std::uint32_t length = big_endian(std::span(start).first(4));
    const std::string_view type(reinterpret_cast<const char*>(start.data()) + 4, 4);
    if (!header) {
      std::array<std::byte, 8> size{};
      if (type != "IHDR" || !read_at(at + 8, size)) return std::nullopt;
      header = with_size({}, big_endian(std::span(size).first(4)), big_endian(std::span(size).last(4)));
      if (!header) return std::nullopt;
    } else if (type == "IDAT" || type == "IEND") {
      return header;
    } else if (type == "eXIf" && length <= kMaxExifBytes) {
      std::vector<std::byte> block(length);
      if (!read_at(at + 8, block)) return std::nullopt;
      header->orientation = Tiff(block).orientation();
    }
    at += kFrameBytes + length;
  }
}

std::optional<PictureHeader> read_header(const ReadAt& read_at) {
  std::array<std::byte, kPngSignature.size()> start{};
  if (!read_at(0, start)) return std::nullopt;
  if (start[0] == std::byte{0xff} && start[1] == std::byte{0xd8}) return read_jpeg_header(read_at);
  if (std::memcmp(start.data(), kPngSignature.data(), start.size()) == 0) return read_png_header(read_at);
  return std::nullopt;
}

}  // namespace

std::optional<PictureHeader> read_picture_header(const std::filesystem::path& path) {
  try {
    return manifests::read_input(path, [](const manifests::FileDescriptor& file) {
      const std::uint64_t size = file.size();
      return read_header([&](std::uint64_t at, std::span<std::byte> bytes) {
        if (at > size || bytes.size() > size - at) return false;
        file.read_at(at, bytes);
        return true;
      });
    });
  } catch (const manifests::IoError& error) {
    if (!error.names_no_file()) throw;
    return std::nullopt;
  }
}

std::optional<PictureHeader> read_picture_header(std::span<const std::byte> content) {
  return read_header([&](std::uint64_t at, std::span<std::byte> bytes) {
    if (at > content.size() || bytes.size() > content.size() - at) return false;
    std::copy_n(content.begin() + static_cast<std::ptrdiff_t>(at), bytes.size(), bytes.begin());
    return true;
  });
}

}  // namespace q3d::loaders::pictures
