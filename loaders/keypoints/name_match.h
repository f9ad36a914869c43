// Finds a topology's keypoints in a file that names its own.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "loaders/keypoints/topology.h"

namespace q3d::loaders::keypoints {

struct NameMatch {
  std::vector<int> places;           // of the topology's keypoints: index in the file's list, or -1
  std::vector<std::string> missing;  // names of the topology that the file lacks
  std::vector<std::string> unknown;  // names of the file that the topology lacks

  // Says which names are missing and which are unknown, for people; empty if there are none.
  std::string note(const Topology& topology) const;
};

// Matches names without regard to letter case and outer spaces. The file may have another order, may lack
// keypoints and may have further ones. Throws std::invalid_argument that lists the names of both sides if a
// name occurs twice in the file, or if fewer than half of the names of the shorter list are in the other:
// such names are spelled in another way or belong to another set.
NameMatch match_names(const Topology& topology, std::span<const std::string> names_in_file);

// Returns the keypoints of a file's list in the topology's order. A missing one has v = 0 and weight 0.
std::vector<manifests::Keypoint> in_topology_order(const NameMatch& match,
                                                   std::span<const manifests::Keypoint> in_file);

}  // namespace q3d::loaders::keypoints
