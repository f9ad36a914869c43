// Topologies that come from a file, so that a lab's own keypoints load without new code.
//
//   {
//     "name": "ap10k17",
//     "about": "where names and map come from",                     (optional)
//     "keypoints": ["left_eye", "right_eye", "nose", ...],          in the order of the annotation files
//     "flip_pairs": [["left_eye", "right_eye"], ...],               mirror images; the others are their own
//     "animal3d26": { "left_eye": "left_eye", "nose": "nose", ... } Animal3D keypoint -> one of "keypoints"
//     "weights": { "neck": 0 }                                      (optional) factors in [0, 1] on the
//     weight
//   }
#pragma once

#include <filesystem>

#include "loaders/topology.h"

namespace q3d::loaders {

// Throws std::runtime_error naming file, key, got and expected: for unknown keys and names, names that occur
// twice, and a map that takes a left keypoint and its mirror image from two that are not each other's.
Topology read_topology_file(const std::filesystem::path& file);

}  // namespace q3d::loaders
