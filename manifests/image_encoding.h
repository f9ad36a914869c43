// The forms in which a shard can hold its pictures.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace q3d::manifests {

// `reference` shards hold no pictures and only name them.
enum class ImageEncoding : std::uint8_t { jpeg, png, reference };
std::string_view to_string(ImageEncoding encoding);
ImageEncoding image_encoding_from_string(std::string_view name);  // throws std::invalid_argument

// The names are in the order of the enumerators.
std::span<const std::string_view> image_encoding_names();

}  // namespace q3d::manifests
