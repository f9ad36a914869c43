// A JSON Schema of the training config, for editors.
#pragma once

#include <nlohmann/json.hpp>

namespace q3d::pipeline::training::settings {

// JSON Schema, draft 2020-12: every key with its type, range, words, default and description. It accepts a
// layer, so that no key is required at the top level, and refuses unknown keys everywhere.
nlohmann::ordered_json training_config_schema();

}  // namespace q3d::pipeline::training::settings
