// Makes the JSON Schema of the objects that tables of settings describe.
#pragma once

#include <nlohmann/json.hpp>

#include <string>
#include <vector>

#include "pipeline/config/setting.h"

namespace q3d::pipeline::config {

// Returns the schema of an object with these keys and no others, all of them optional.
nlohmann::ordered_json object_schema(const std::vector<SettingFacts>& settings);
// Returns the same schema, in which keys without a default are required.
nlohmann::ordered_json whole_object_schema(const std::vector<SettingFacts>& settings);
// Returns the schema of an object as a document, draft 2020-12.
nlohmann::ordered_json schema_document(const std::string& title, const nlohmann::ordered_json& object);

}  // namespace q3d::pipeline::config
