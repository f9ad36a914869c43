#include "loaders/pictures/jpeg.h"

#include <fmt/format.h>

#include <array>
#include <csetjmp>
#include <cstdio>  // jpeglib.h needs FILE and size_t
#include <memory>
#include <new>
#include <optional>

#include <jpeglib.h>

#include <jerror.h>

namespace q3d::loaders::pictures {
namespace {

using manifests::Reason;

// A progressive file may repeat scans over the whole picture; no encoder writes more than a few dozen.
constexpr int kMaxScans = 500;

// libjpeg reports errors by a callback that must not return, so it jumps back to run(). Nothing on the way
// may own memory: this struct is plain, and the pixel buffer belongs to the caller.
struct Decoder {
  jpeg_decompress_struct info{};
  jpeg_error_mgr errors{};
  jpeg_progress_mgr progress{};
  std::jmp_buf give_up{};
  std::array<char, JMSG_LENGTH_MAX> message{};
  bool ended_early = false;
  bool too_many_scans = false;
  std::span<const std::byte> bytes;
  std::uint8_t* pixels = nullptr;
  std::size_t row_bytes = 0;
  cv::Rect region;  // of the picture, for read_region
};

Decoder& owner(j_common_ptr info) {
  return *static_cast<Decoder*>(info->client_data);
}

void on_error(j_common_ptr info) {
  Decoder& decoder = owner(info);
  info->err->format_message(info, decoder.message.data());
  std::longjmp(decoder.give_up, 1);
}

void on_message(j_common_ptr info, int level) {
  if (level >= 0) return;  // tracing
  const int code = info->err->msg_code;
  if (code == JWRN_JPEG_EOF || code == JWRN_HIT_MARKER) owner(info).ended_early = true;
}

void on_progress(j_common_ptr info) {
  Decoder& decoder = owner(info);
  if (decoder.info.input_scan_number <= kMaxScans) return;
  decoder.too_many_scans = true;
  std::longjmp(decoder.give_up, 1);
}

void read_header(Decoder& decoder) {
  jpeg_create_decompress(&decoder.info);  // keeps err and client_data
  decoder.info.progress = &decoder.progress;
  jpeg_mem_src(&decoder.info, reinterpret_cast<const unsigned char*>(decoder.bytes.data()),
               static_cast<unsigned long>(decoder.bytes.size()));
  jpeg_read_header(&decoder.info, TRUE);
}

void read_rows(Decoder& decoder) {
  jpeg_start_decompress(&decoder.info);
  while (decoder.info.output_scanline < decoder.info.output_height) {
    JSAMPROW row = decoder.pixels + decoder.info.output_scanline * decoder.row_bytes;
    jpeg_read_scanlines(&decoder.info, &row, 1);
  }
  jpeg_finish_decompress(&decoder.info);
}

// Starts the region. libjpeg widens it to whole blocks on its left.
void begin_region(Decoder& decoder) {
  jpeg_start_decompress(&decoder.info);
  auto left = static_cast<JDIMENSION>(decoder.region.x);
  auto width = static_cast<JDIMENSION>(decoder.region.width);
  jpeg_crop_scanline(&decoder.info, &left, &width);
  decoder.region.x = static_cast<int>(left);
  decoder.region.width = static_cast<int>(width);
}

void read_region(Decoder& decoder) {
  const auto top = static_cast<JDIMENSION>(decoder.region.y);
  if (top > 0) jpeg_skip_scanlines(&decoder.info, top);
  const JDIMENSION end = top + static_cast<JDIMENSION>(decoder.region.height);
  while (decoder.info.output_scanline < end) {
    JSAMPROW row = decoder.pixels + (decoder.info.output_scanline - top) * decoder.row_bytes;
    jpeg_read_scanlines(&decoder.info, &row, 1);
  }
  jpeg_abort_decompress(&decoder.info);
}

// Returns false if libjpeg gave up inside `step`.
bool run(Decoder& decoder, void (*step)(Decoder&)) {
  if (setjmp(decoder.give_up) != 0) return false;
  step(decoder);
  return true;
}

DecodedImage failed(const Decoder& decoder) {
  if (decoder.errors.msg_code == JERR_OUT_OF_MEMORY) throw std::bad_alloc();  // not the picture's fault
  if (decoder.ended_early) return {{}, Reason::image_truncated, "the JPEG data end before the picture does"};
  if (decoder.too_many_scans) {
    return {{}, Reason::image_too_large, fmt::format("got a JPEG with more than {} scans", kMaxScans)};
  }
  return {
      {}, Reason::image_not_an_image, fmt::format("JPEG that cannot be decoded: {}", decoder.message.data())};
}

// Converts as PIL's CMYK;I and convert('RGB') do: the stored bytes are inverted ink, and black scales the
// rest.
cv::Mat rgb_from_inverted_cmyk(const cv::Mat& cmyk) {
  cv::Mat rgb(cmyk.size(), CV_8UC3);
  for (int y = 0; y < cmyk.rows; ++y) {
    const auto* from = cmyk.ptr<cv::Vec4b>(y);
    auto* to = rgb.ptr<cv::Vec3b>(y);
    for (int x = 0; x < cmyk.cols; ++x) {
      const int light = from[x][3];
      for (int c = 0; c < 3; ++c) {
        const int product = (255 - from[x][c]) * light + 128;
        to[x][c] = static_cast<std::uint8_t>(light - ((product + (product >> 8)) >> 8));
      }
    }
  }
  return rgb;
}

// Reads the header and chooses the colour space. Returns the failure, if there is one.
std::optional<DecodedImage> begin(Decoder& decoder) {
  if (!run(decoder, read_header)) return failed(decoder);
  const auto width = static_cast<std::int64_t>(decoder.info.image_width);
  const auto height = static_cast<std::int64_t>(decoder.info.image_height);
  if (width * height > kMaxPixels) {
    return DecodedImage{
        {},
        Reason::image_too_large,
        fmt::format("got a JPEG of {} x {} px, expected at most {} px", width, height, kMaxPixels)};
  }
  decoder.info.out_color_space = decoder.info.num_components == 4 ? JCS_CMYK : JCS_RGB;
  return std::nullopt;
}

cv::Mat room_for_pixels(Decoder& decoder, int width, int height) {
  const bool is_cmyk = decoder.info.num_components == 4;
  cv::Mat pixels(height, width, is_cmyk ? CV_8UC4 : CV_8UC3);
  decoder.pixels = pixels.data;
  decoder.row_bytes = pixels.step;
  return pixels;
}

DecodedImage finished(const Decoder& decoder, const cv::Mat& pixels) {
  return {decoder.info.num_components == 4 ? rgb_from_inverted_cmyk(pixels) : pixels, Reason::none, {}};
}

DecodedImage decode_with(Decoder& decoder) {
  if (auto failure = begin(decoder)) return *failure;
  const cv::Mat pixels = room_for_pixels(decoder, static_cast<int>(decoder.info.image_width),
                                         static_cast<int>(decoder.info.image_height));
  if (!run(decoder, read_rows) || decoder.ended_early) return failed(decoder);
  return finished(decoder, pixels);
}

DecodedRegion decode_region_with(Decoder& decoder, const cv::Rect& wanted) {
  if (auto failure = begin(decoder)) return {*failure, {}};
  // Colours are stored at half the resolution, so a pixel's colour depends on its neighbours, which libjpeg
  // does not know beyond the edge of a region.
  constexpr int kNeighboursPx = 4;
  const cv::Rect all(0, 0, static_cast<int>(decoder.info.image_width),
                     static_cast<int>(decoder.info.image_height));
  const cv::Rect wider(wanted.x - kNeighboursPx, wanted.y - kNeighboursPx, wanted.width + 2 * kNeighboursPx,
                       wanted.height + 2 * kNeighboursPx);
  decoder.region = wider & all;
  if (decoder.region.empty()) decoder.region = cv::Rect(0, 0, 1, 1);
  if (!run(decoder, begin_region)) return {failed(decoder), {}};
  const cv::Mat pixels = room_for_pixels(decoder, decoder.region.width, decoder.region.height);
  if (!run(decoder, read_region) || decoder.ended_early) return {failed(decoder), {}};
  return {finished(decoder, pixels), decoder.region.tl()};
}

// Creates a decoder, calls decode(decoder) and destroys the decoder.
template <typename Decode>
auto with_decoder(std::span<const std::byte> bytes, Decode&& decode) {
  Decoder decoder;
  decoder.bytes = bytes;
  decoder.info.client_data = &decoder;
  decoder.info.err = jpeg_std_error(&decoder.errors);
  decoder.errors.error_exit = on_error;
  decoder.errors.emit_message = on_message;
  decoder.progress.progress_monitor = on_progress;
  const std::unique_ptr<jpeg_decompress_struct, void (*)(jpeg_decompress_struct*)> guard(
      &decoder.info, jpeg_destroy_decompress);
  return decode(decoder);
}

}  // namespace

bool is_jpeg(std::span<const std::byte> bytes) {
  return bytes.size() >= 2 && bytes[0] == std::byte{0xff} && bytes[1] == std::byte{0xd8};
}

DecodedImage decode_jpeg(std::span<const std::byte> bytes) {
  return with_decoder(bytes, decode_with);
}

DecodedRegion decode_jpeg_region(std::span<const std::byte> bytes, const cv::Rect& wanted) {
  return with_decoder(bytes, [&](Decoder& decoder) { return decode_region_with(decoder, wanted); });
}

}  // namespace q3d::loaders::pictures
