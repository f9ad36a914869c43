// Named layers under a config: `"profile": "strict"`.
#pragma once

#include <nlohmann/json.hpp>

#include <string>
#include <vector>

namespace q3d::pipeline::config {

std::vector<std::string> profile_names();

// Returns the config layer of a profile, over which the config itself is laid. "paper" is the paper's rule
// alone, an empty layer. Throws std::out_of_range for a name that is not in profile_names().
const nlohmann::json& profile_layer(const std::string& name);

}  // namespace q3d::pipeline::config
