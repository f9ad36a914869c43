// A 64-bit hash of what a picture looks like. Loaders compute it, filters compare it, and the pipeline stores
// it.
#pragma once

#include <cstdint>

namespace q3d::manifests {

struct PictureHash {
  std::uint64_t upright = 0;   // hash of the picture
  std::uint64_t mirrored = 0;  // hash of its left-right mirror image
  bool operator==(const PictureHash&) const = default;
};

}  // namespace q3d::manifests
