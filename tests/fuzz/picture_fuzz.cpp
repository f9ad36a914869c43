// Pictures and masks: JPEG and PNG, and what only claims to be.
#include <span>

#include "loaders/pictures/image.h"
#include "loaders/pictures/picture_header.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using q3d::fuzz::require;
  using q3d::manifests::Reason;
  const auto bytes = std::as_bytes(std::span(data, size));
  const q3d::loaders::pictures::DecodedImage image = q3d::loaders::pictures::decode_image(bytes);
  if (image.failure == Reason::none) {
    require(!image.rgb.empty() && image.rgb.type() == CV_8UC3, "a decoded picture is 8-bit RGB");
  } else {
    require(image.rgb.empty() && !image.detail.empty(), "a picture that failed says why", image.detail);
  }
  if (const auto header = q3d::loaders::pictures::read_picture_header(bytes)) {
    require(header->orientation >= 1 && header->orientation <= 8, "an orientation is one of EXIF's");
    const bool is_decoded = image.failure == Reason::none;
    require(!is_decoded || (header->width_px == image.rgb.cols && header->height_px == image.rgb.rows),
            "the header has the size of the pixels");
  }
  const q3d::loaders::pictures::DecodedMask mask = q3d::loaders::pictures::decode_mask(bytes);
  require(mask.silhouette.empty() || mask.silhouette.type() == CV_8UC1, "a silhouette has one channel");
  return 0;
}
