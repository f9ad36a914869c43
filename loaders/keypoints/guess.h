// Guesses a topology from the names of keypoints, so that people have a file to correct instead of an empty
// one.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <span>
#include <string>
#include <vector>

#include "loaders/keypoints/topology.h"

namespace q3d::loaders::keypoints {

struct TopologyGuess {
  Topology topology;
  std::vector<std::string> doubts;  // a sentence for each thing that a person should look at
};

// Guesses mirror images and the map to the 26 from names in English. A name maps to one of the 26 only if it
// states side and end of the body where the 26 distinguish them, and if its mirror image maps as well.
// Uncertain keypoints are left out or listed among the doubts. Throws std::invalid_argument if there are no
// names, or if one occurs twice.
TopologyGuess guess_topology(const std::string& name, std::span<const std::string> names);

// Returns the topology in the form of a topology file (topology_file.h).
nlohmann::ordered_json topology_json(const Topology& topology, const std::string& about);

}  // namespace q3d::loaders::keypoints
