// The topology files of configs/topologies, which are part of the program.
#pragma once

#include <filesystem>
#include <span>
#include <string_view>

namespace q3d::loaders::keypoints {

struct BuiltinTopology {
  std::string_view name;  // the file's name without .json, such as "ap10k"
  std::string_view text;  // the file, JSON
};

// All of them, sorted by name. The build makes this function (cmake/Q3dEmbedTopologies.cmake).
std::span<const BuiltinTopology> builtin_topologies();

// Returns true if a config's "topology" is the name of a built-in one. Such a value is not a path:
// a file of the same name is given as "./NAME".
bool is_builtin_topology(const std::filesystem::path& name_or_file);

}  // namespace q3d::loaders::keypoints
