// Pictures and masks: JPEG and PNG, and what only claims to be.
#include <span>

#include "loaders/pictures/image.h"
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
  const q3d::loaders::pictures::DecodedMask mask = q3d::loaders::pictures::decode_mask(bytes);
  require(mask.silhouette.empty() || mask.silhouette.type() == CV_8UC1, "a silhouette has one channel");
  return 0;
}
