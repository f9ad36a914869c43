// Keypoint topologies: the names of a dataset's keypoints, their mirror images and the way to the 26 of
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
  std::vector<std::string> keypoints;                  // in the order of the files
  std::vector<int> flip;                               // index of each keypoint's mirror image
  std::array<int, manifests::kNumKeypoints> source{};  // Animal3D keypoint -> index here, or -1
  std::vector<float> weights;                          // a factor in [0, 1] on each keypoint's weight
};

// Those of the formats that this program reads without a topology file: animal3d26, superanimal_quadruped39,
// animal_kingdom23. Any other comes from a file (loaders/keypoints/topology_file.h).
std::span<const Topology> topologies();

// Throws std::invalid_argument that lists the known names.
const Topology& topology(std::string_view name);

// Where each keypoint of the topology stands in a file that lists its own names, which may be in another
// order (AwA-Pose has SuperAnimal's 39 in a different one). Letter case and outer spaces do not count. Throws
// std::invalid_argument naming the first name that is missing or one too many.
std::vector<int> order_in_file(const Topology& topology, std::span<const std::string> names_in_file);

// The 26 of Animal3D from a topology's own keypoints (as many as it has), each weight times the topology's;
// what has no source gets v = 0.
manifests::Keypoints to_animal3d(const Topology& topology, std::span<const manifests::Keypoint> keypoints);

}  // namespace q3d::loaders::keypoints
