// Keypoint topologies: the names of a dataset's keypoints, their mirror images, and their map to the 26 of
// Animal3D.
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/sample.h"

namespace q3d::loaders::keypoints {

struct Topology {
  std::string name;
  std::vector<std::string> keypoints;                  // in the order of the annotation files
  std::vector<int> flip;                               // index of each keypoint's mirror image
  std::array<int, manifests::kNumKeypoints> source{};  // Animal3D keypoint -> index here, or -1
  std::vector<float> weights;                          // a factor in [0, 1] on each keypoint's weight
};

// Returns the topologies of the formats that need no topology file: animal3d26, superanimal_quadruped39,
// animal_kingdom23. All others come from a file (loaders/keypoints/topology_file.h).
std::span<const Topology> topologies();

// Returns the topology of this name. Throws std::invalid_argument that lists the known names if there is
// none.
const Topology& topology(std::string_view name);

// Maps a topology's own keypoints, all of them, to the 26 of Animal3D. Each weight is multiplied by the
// topology's. A keypoint without a source gets v = 0.
manifests::Keypoints to_animal3d(const Topology& topology, std::span<const manifests::Keypoint> keypoints);

}  // namespace q3d::loaders::keypoints
