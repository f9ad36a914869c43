// Reads topologies from files, so that a lab's own keypoints load without new code.
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
// "keypoints" are in the order of the annotation files. "flip_pairs" are mirror images of each other; a
// keypoint in no pair is its own mirror image. "animal3d26" gives the source of each of the 26 that has one.
// "weights" are factors in [0, 1] on a keypoint's weight; the default is 1. "about" and "weights" are
// optional.
#pragma once

#include <filesystem>

#include "loaders/keypoints/topology.h"

namespace q3d::loaders::keypoints {

// Reads a topology from a file, or the built-in one of this name (builtin_topologies.h). Throws
// std::runtime_error that names file and key, what was found and what was expected: for unknown keys and
// names, for names that occur twice, and for a map in which a left keypoint and its mirror image come from
// two keypoints that are not mirror images of each other. Lists the built-in topologies if there is no such
// file.
Topology read_topology_file(const std::filesystem::path& name_or_file);

}  // namespace q3d::loaders::keypoints
