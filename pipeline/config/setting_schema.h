// JSON Schema of the objects that tables of settings describe.
#pragma once

#include <nlohmann/json.hpp>

#include <string>
#include <vector>

#include "pipeline/config/setting.h"

namespace q3d::pipeline::config {

// An object with these keys and no others; none of them must be there.
nlohmann::ordered_json object_schema(const std::vector<SettingFacts>& settings);
// The same, but the keys without a default must be there.
nlohmann::ordered_json whole_object_schema(const std::vector<SettingFacts>& settings);
// The object as a document of its own, draft 2020-12.
nlohmann::ordered_json schema_document(const std::string& title, const nlohmann::ordered_json& object);

}  // namespace q3d::pipeline::config
