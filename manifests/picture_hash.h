// What a picture looks like, in 64 bits: loaders make it, filters compare it, the pipeline remembers it.
#pragma once

#include <cstdint>

namespace q3d::manifests {

struct PictureHash {
  std::uint64_t upright = 0;   // of the picture
  std::uint64_t mirrored = 0;  // of its left-right mirror image
  bool operator==(const PictureHash&) const = default;
};

}  // namespace q3d::manifests
