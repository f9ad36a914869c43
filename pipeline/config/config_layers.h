// Reads the parts that all configurations of this program share: JSON files laid over each other, and words
// from a list.
#pragma once

#include <nlohmann/json.hpp>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace q3d::pipeline::config {

struct ConfigLayers {
  nlohmann::json resolved;    // the merged JSON with absolute paths
  nlohmann::json as_written;  // the same with paths as the user wrote them
  std::string where;          // the files' names, for messages
};

// Reads the files in order; a later file's keys replace an earlier one's. `settings` are single keys that
// replace those of the files (config_override.h); their paths start from the current folder. `resolve_paths`
// makes the paths of one file absolute, given the file's folder. Throws ConfigError naming the file.
ConfigLayers read_config_layers(
    const std::vector<std::filesystem::path>& files,
    const std::function<void(nlohmann::json& layer, const std::filesystem::path& folder)>& resolve_paths,
    const std::vector<std::string>& settings = {});

// Makes the path object[key] absolute if it is a text.
void resolve_path(nlohmann::json& object, const char* key, const std::filesystem::path& folder);

// Throws ConfigError that lists the known words and names the nearest.
void require_one_of(const std::string& value, const std::vector<std::string>& known,
                    const std::string& where);

}  // namespace q3d::pipeline::config
