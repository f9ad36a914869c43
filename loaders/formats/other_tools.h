// JSON of tools that a user may take for COCO.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace q3d::loaders::formats {

// Says whose file this is and how to get COCO from it; empty if the document has none of the known forms.
std::string known_tool(const nlohmann::json& document);

}  // namespace q3d::loaders::formats
