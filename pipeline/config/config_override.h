// Sets single keys of a config from the command line: `--set tta.learning_rate=2e-6`.
#pragma once

#include <nlohmann/json.hpp>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace q3d::pipeline::config {

struct ConfigOverride {
  std::string text;               // as it was given, for messages
  std::vector<std::string> keys;  // from the top level down
  nlohmann::json value;
};

// Reads KEY=VALUE. Dots separate the keys of nested objects. A key that begins with '/' is separated by '/'
// instead, for names that contain dots. The value is JSON if it can be read as JSON, else it is a text.
// Throws ConfigError if there is no key.
ConfigOverride parse_override(const std::string& text);

// Puts the value into `resolved` and `as_written`, as another config file on top of the others would. An
// object is merged into the object that is there, null takes the key away, anything else replaces what is
// there. Objects that are missing on the way are made. A member of a list is named by its place from 0, or by
// its "name" (`datasets.walk.species=goat`).
//
// `resolve_paths` makes relative paths of a layer absolute (config_layers.h). They start from `folder`.
// Throws ConfigError if a list has no such member, or if a key leads into a value that holds no keys.
void apply_override(
    const ConfigOverride& given,
    const std::function<void(nlohmann::json& layer, const std::filesystem::path& folder)>& resolve_paths,
    const std::filesystem::path& folder, nlohmann::json& resolved, nlohmann::json& as_written);

}  // namespace q3d::pipeline::config
