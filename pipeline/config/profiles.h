// Named layers under a config: `"profile": "strict"`.
#pragma once

#include <nlohmann/json.hpp>

#include <string>
#include <vector>

namespace q3d::pipeline::config {

std::vector<std::string> profile_names();

// The config layer that a profile stands for; what the config itself says is laid over it. "paper" is the
// paper's rule alone, an empty layer. Throws std::out_of_range on another name than those of profile_names().
const nlohmann::json& profile_layer(const std::string& name);

}  // namespace q3d::pipeline::config
