#include "manifests/image_encoding.h"

#include "manifests/enum_names.h"

namespace q3d::manifests {
namespace {

constexpr EnumNames kNames("image encoding", ImageEncoding::jpeg, ImageEncoding::reference,
                           {"jpeg", "png", "reference"});

}  // namespace

std::string_view to_string(ImageEncoding encoding) {
  return kNames.name(encoding);
}

ImageEncoding image_encoding_from_string(std::string_view name) {
  return kNames.value(name);
}

std::span<const std::string_view> image_encoding_names() {
  return kNames.all();
}

}  // namespace q3d::manifests
