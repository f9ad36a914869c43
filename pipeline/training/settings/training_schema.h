// A JSON Schema of the training config, for editors.
#pragma once

#include <nlohmann/json.hpp>

namespace q3d::pipeline::training::settings {

// Returns a JSON Schema, draft 2020-12, with every key's type, range, words, default and description. It
// accepts a layer, so no key is required at the top level. It refuses unknown keys everywhere.
nlohmann::ordered_json training_config_schema();

}  // namespace q3d::pipeline::training::settings
