// Seeded choices among a sample's visible keypoints. They are the same on every machine.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "smal/keypoints.h"

namespace q3d::filters {

// Returns the visible keypoints of `annotated` in a random order that depends on seed and sample id. A prefix
// of this order is a choice, so a shorter choice is part of a longer one.
std::vector<std::size_t> shuffled_visible(const smal::CropKeypoints& annotated, std::uint64_t seed,
                                          const std::string& sample_id);

using KeypointFlags = std::array<bool, smal::kNumKeypoints>;

// Chooses the keypoints that adaptation does not see: round(share * visible) of the visible ones, with halves
// rounded up, at least one and never all. It chooses none of a sample with fewer than two. Throws
// std::invalid_argument unless 0 < share < 1.
KeypointFlags held_out_keypoints(const smal::CropKeypoints& annotated, double share, std::uint64_t seed,
                                 const std::string& sample_id);

}  // namespace q3d::filters
