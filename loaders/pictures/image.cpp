#include "loaders/pictures/image.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <new>
#include <string_view>

#include "loaders/pictures/jpeg.h"
#include "loaders/pictures/png.h"
#include "manifests/digest.h"
#include "manifests/file_descriptor.h"

namespace q3d::loaders::pictures {
namespace {

using manifests::Reason;

std::string_view as_text(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

struct Signature {
  std::string_view start;
  std::string_view name;
};
using namespace std::string_view_literals;
constexpr std::array<Signature, 7> kOtherFormats{{{"GIF8"sv, "a GIF picture"},
                                                  {"BM"sv, "a BMP picture"},
                                                  {"RIFF"sv, "a WebP picture or another RIFF file"},
                                                  {"II*\0"sv, "a TIFF picture"},
                                                  {"MM\0*"sv, "a TIFF picture"},
                                                  {"<"sv, "an HTML or XML page"},
                                                  {"PK\3\4"sv, "a ZIP archive"}}};

DecodedImage unreadable(std::span<const std::byte> bytes) {
  const std::string_view text = as_text(bytes);
  if (text.starts_with("version https://git-lfs")) {
    return {{}, Reason::image_is_lfs_pointer, "a Git-LFS pointer, not the picture: run `git lfs pull`"};
  }
  for (const auto& [start, name] : kOtherFormats) {
    if (text.starts_with(start)) {
      return {{}, Reason::image_not_an_image, fmt::format("got {}, expected JPEG or PNG content", name)};
    }
  }
  std::string start;
  for (const std::byte value : bytes.first(std::min<std::size_t>(bytes.size(), 8))) {
    start += fmt::format(" {:02x}", std::to_integer<unsigned>(value));
  }
  return {{},
          Reason::image_not_an_image,
          fmt::format("got {} bytes that start with{}, expected JPEG or PNG content", bytes.size(), start)};
}

// Computes PIL's convert('L') of RGB: ITU-R 601-2 luma in 16-bit fixed point.
cv::Mat luma(const cv::Mat& rgb) {
  cv::Mat grey(rgb.size(), CV_8UC1);
  for (int y = 0; y < rgb.rows; ++y) {
    const auto* row = rgb.ptr<cv::Vec3b>(y);
    std::transform(row, row + rgb.cols, grey.ptr<std::uint8_t>(y), [](const cv::Vec3b& pixel) {
      return static_cast<std::uint8_t>((19595 * pixel[0] + 38470 * pixel[1] + 7471 * pixel[2] + 0x8000) >>
                                       16);
    });
  }
  return grey;
}

// A mask has few pixels between dark and bright (soft edges, JPEG ringing); a photograph has many.
constexpr int kDarkBelow = 32;
constexpr int kBrightFrom = 224;
constexpr double kMaxMidtones = 0.1;

MaskKind kind_of(const cv::Mat& grey) {
  std::array<std::int64_t, 256> count{};
  for (const std::uint8_t value : cv::Mat_<std::uint8_t>(grey)) ++count[value];
  const auto levels = std::count_if(count.begin() + 1, count.end(), [](auto n) { return n > 0; });
  if (levels == 0) return MaskKind::blank;
  const auto brightest = std::find_if(count.rbegin(), count.rend(), [](auto n) { return n > 0; });
  if (levels == 1 && count.rend() - brightest - 1 < 128) return MaskKind::low_valued;
  std::int64_t midtones = 0;
  for (int value = kDarkBelow; value < kBrightFrom; ++value)
    midtones += count[static_cast<std::size_t>(value)];
  return static_cast<double>(midtones) > kMaxMidtones * static_cast<double>(grey.total())
             ? MaskKind::picture
             : MaskKind::silhouette;
}

// Completes what was decoded from the bytes of a file.
template <typename Decoded>
Decoded of_file(const std::filesystem::path& path, std::span<const std::byte> bytes, Decoded decoded) {
  decoded.sha256 = manifests::sha256(bytes);
  if (decoded.failure != Reason::none) decoded.detail = path.filename().string() + ": " + decoded.detail;
  return decoded;
}

}  // namespace

FileBytes read_picture_file(const std::filesystem::path& path) {
  try {
    return manifests::read_input(path, [&](const manifests::FileDescriptor& file) -> FileBytes {
      const std::uint64_t size = file.size();
      if (size > kMaxFileBytes) {
        return {{},
                Reason::image_too_large,
                fmt::format("{}: got {} bytes, expected at most {}", path.filename().string(), size,
                            kMaxFileBytes)};
      }
      FileBytes content;
      content.bytes.resize(size);
      file.read_at(0, content.bytes);
      return content;
    });
  } catch (const manifests::IoError& error) {
    if (!error.names_no_file()) throw;
    const Reason reason = error.code() == EISDIR ? Reason::image_not_an_image : Reason::image_missing;
    return {{}, reason, fmt::format("{}: {}", path.filename().string(), error.reason())};
  }
}

DecodedImage decode_image(std::span<const std::byte> bytes) {
  if (bytes.empty()) return {{}, Reason::image_empty, "got an empty file"};
  try {
    if (is_jpeg(bytes)) return decode_jpeg(bytes);
    if (is_png(bytes)) return decode_png(bytes);
  } catch (const cv::Exception& error) {
    if (error.code == cv::Error::StsNoMem) throw std::bad_alloc();
    throw;
  }
  return unreadable(bytes);
}

DecodedImage decode_image(const std::filesystem::path& path) {
  FileBytes file = read_picture_file(path);
  if (file.failure != Reason::none) return {{}, file.failure, std::move(file.detail)};
  return of_file(path, file.bytes, decode_image(file.bytes));
}

DecodedMask decode_mask(std::span<const std::byte> bytes) {
  DecodedImage decoded = decode_image(bytes);
  if (decoded.failure != Reason::none) {
    return {{}, MaskKind::absent, decoded.failure, std::move(decoded.detail)};
  }
  cv::Mat grey = luma(decoded.rgb);
  const MaskKind kind = kind_of(grey);
  if (kind == MaskKind::low_valued) grey = grey > 0;
  const bool usable = kind == MaskKind::low_valued || kind == MaskKind::silhouette;
  return {usable ? grey : cv::Mat(), kind, Reason::none, {}};
}

DecodedMask decode_mask(const std::filesystem::path& path) {
  if (path.empty()) return {};
  FileBytes file = read_picture_file(path);
  if (file.failure != Reason::none) return {{}, MaskKind::absent, file.failure, std::move(file.detail)};
  return of_file(path, file.bytes, decode_mask(file.bytes));
}

}  // namespace q3d::loaders::pictures
