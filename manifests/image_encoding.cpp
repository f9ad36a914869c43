#include "manifests/image_encoding.h"

#include "manifests/enum_names.h"

namespace q3d::manifests {
namespace {

constexpr std::array<std::string_view, 3> kNames{"jpeg", "png", "reference"};
static_assert(kNames.size() == static_cast<std::size_t>(ImageEncoding::reference) + 1);

}  // namespace

std::string_view to_string(ImageEncoding encoding) {
  return kNames.at(static_cast<std::size_t>(encoding));
}

ImageEncoding image_encoding_from_string(std::string_view name) {
  return enum_from_name<ImageEncoding>("image encoding", name, kNames);
}

std::span<const std::string_view> image_encoding_names() {
  return kNames;
}

}  // namespace q3d::manifests
