// Seeded choices among a sample's visible keypoints, the same on every machine.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "manifests/sample.h"

namespace q3d::filters {

// The visible (weight > 0) ones of `annotated`, 26 x (x, y, weight), in a random order by seed and sample id.
// A prefix of it is a choice: a shorter one is part of a longer one. Throws std::invalid_argument on another
// count.
std::vector<std::size_t> shuffled_visible(std::span<const float> annotated, std::uint64_t seed,
                                          const std::string& sample_id);

using KeypointFlags = std::array<bool, manifests::kNumKeypoints>;

// The keypoints that adaptation does not see: round(share * visible) of the visible ones, halves up, at least
// one and not all. None of a sample with fewer than two. 0 < share < 1, else std::invalid_argument.
KeypointFlags held_out_keypoints(std::span<const float> annotated, double share, std::uint64_t seed,
                                 const std::string& sample_id);

}  // namespace q3d::filters
