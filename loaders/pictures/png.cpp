#include "loaders/pictures/png.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string_view>
#include <utility>

namespace q3d::loaders::pictures {
namespace {

using manifests::Reason;

constexpr std::array<unsigned char, 8> kSignature{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
constexpr std::size_t kChunkFrame = 12;  // length, type and checksum, four bytes each
// IHDR: width, height, bit depth, colour type, three methods.
constexpr std::size_t kHeaderBytes = 13;
constexpr std::size_t kColourTypeAt = 9;
constexpr unsigned char kPaletteColourType = 3;

std::uint32_t big_endian(const unsigned char* at) {
  return std::uint32_t{at[0]} << 24U | std::uint32_t{at[1]} << 16U | std::uint32_t{at[2]} << 8U | at[3];
}

struct Chunk {
  std::string_view type;
  std::span<const unsigned char> whole;  // the chunk with its length, type and checksum
  std::span<const unsigned char> data() const { return whole.subspan(8, whole.size() - kChunkFrame); }
  bool is_intact() const {
    const uLong sum = crc32(0, whole.data() + 4, static_cast<uInt>(whole.size() - 8));
    return sum == big_endian(whole.data() + whole.size() - 4);
  }
};

// Returns the chunk at the start of `rest`; empty if the file ends before the chunk does.
Chunk chunk_at(std::span<const unsigned char> rest) {
  if (rest.size() < kChunkFrame) return {};
  const std::size_t size = big_endian(rest.data()) + kChunkFrame;
  if (rest.size() < size) return {};
  return {{reinterpret_cast<const char*>(rest.data()) + 4, 4}, rest.first(size)};
}

DecodedImage damaged(std::string what) {
  return {{}, Reason::image_not_an_image, "damaged PNG: " + what};
}

// The state of the pixel data chunks that were read so far.
struct PixelChunks {
  std::vector<unsigned char> file{kSignature.begin(), kSignature.end()};
  bool has_header = false;
  bool is_palette = false;
  bool has_palette = false;
  bool has_pixels = false;
};

// Adds a chunk and returns what is wrong with it, or "". libpng would report it too, but on stderr.
std::string add_chunk(const Chunk& chunk, PixelChunks& pixels) {
  const bool is_header = chunk.type == "IHDR";
  const bool is_word =
      std::all_of(chunk.type.begin(), chunk.type.end(), [](unsigned char c) { return c > 0x20 && c < 0x7f; });
  const std::string name = fmt::format("chunk {}", is_word ? chunk.type : "of no name");
  if (is_header == pixels.has_header)
    return is_header ? "a second header" : name + " where the header belongs";
  if (!chunk.is_intact()) return name + " fails its checksum";
  if (is_header) {
    if (chunk.data().size() != kHeaderBytes) return "a header of a wrong size";
    pixels.has_header = true;
    pixels.is_palette = chunk.data()[kColourTypeAt] == kPaletteColourType;
  } else if (chunk.type == "PLTE") {
    pixels.has_palette = true;
  } else if (chunk.type == "IDAT") {
    if (pixels.is_palette && !pixels.has_palette) return "no palette before the pixels";
    pixels.has_pixels = true;
  } else if (chunk.type == "IEND") {
    if (!pixels.has_pixels) return "no pixels";
  } else {
    return {};  // colour profile, EXIF and text are dropped
  }
  pixels.file.insert(pixels.file.end(), chunk.whole.begin(), chunk.whole.end());
  return {};
}

DecodedImage decode_plain(const std::vector<unsigned char>& file) {
  try {
    cv::Mat image = cv::imdecode(file, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
    if (image.empty()) return damaged("its pixel data cannot be unpacked");
    cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
    return {image, Reason::none, {}};
  } catch (const cv::Exception& error) {
    if (error.code == cv::Error::StsNoMem) throw;  // this is not the picture's fault
    return damaged(error.err);
  }
}

}  // namespace

bool is_png(std::span<const std::byte> bytes) {
  const auto* start = reinterpret_cast<const unsigned char*>(bytes.data());
  return bytes.size() >= kSignature.size() && std::equal(kSignature.begin(), kSignature.end(), start);
}

DecodedImage decode_png(std::span<const std::byte> bytes) {
  std::span rest(reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  rest = rest.subspan(kSignature.size());
  PixelChunks pixels;
  for (std::string_view type; type != "IEND";) {
    const Chunk chunk = chunk_at(rest);
    if (chunk.whole.empty()) return {{}, Reason::image_truncated, "the file ends inside the PNG"};
    rest = rest.subspan(chunk.whole.size());
    type = chunk.type;
    std::string problem = add_chunk(chunk, pixels);
    if (!problem.empty()) return damaged(std::move(problem));
    if (type != "IHDR") continue;
    const std::int64_t width = big_endian(chunk.data().data());
    const std::int64_t height = big_endian(chunk.data().data() + 4);
    if (width > kMaxPixels || height > kMaxPixels || width * height > kMaxPixels) {
      return {{},
              Reason::image_too_large,
              fmt::format("got a PNG of {} x {} px, expected at most {} px", width, height, kMaxPixels)};
    }
  }
  return decode_plain(pixels.file);
}

}  // namespace q3d::loaders::pictures
