// Topologies that come from a file, so that a lab's own keypoints load without new code.
//
//   {
//     "name": "ap10k17",
//     "about": "where names and map come from",
//     "keypoints": ["left_eye", "right_eye", "nose", ...],
//     "flip_pairs": [["left_eye", "right_eye"], ...],
//     "animal3d26": { "left_eye": "left_eye", "nose": "nose", ... },
//     "weights": { "neck": 0 }
//   }
//
// "keypoints" are in the order of the annotation files; "flip_pairs" are mirror images, and what is in none
// is its own; "animal3d26" gives, for each of the 26 that has one, the keypoint it is taken from; "weights"
// are factors in [0, 1] on a keypoint's weight, 1 for the others. "about" and "weights" may be left out.
#pragma once

#include <filesystem>

#include "loaders/keypoints/topology.h"

namespace q3d::loaders::keypoints {

// Throws std::runtime_error naming file, key, got and expected: for unknown keys and names, names that occur
// twice, and a map that takes a left keypoint and its mirror image from two that are not each other's.
Topology read_topology_file(const std::filesystem::path& file);

}  // namespace q3d::loaders::keypoints
