// Writes the status of an output folder as text and as JSON.
#pragma once

#include <nlohmann/json.hpp>

#include <string>

#include "pipeline/status/folder_status.h"

namespace q3d::pipeline::status {

// Returns a table with one line for each stage of the build, with its missing units. Every line begins with
// `indent`.
std::string stage_table(const BuildStatus& build, const std::string& indent);

// Returns the status of the whole folder for people.
std::string page(const FolderStatus& status);

nlohmann::ordered_json to_json(const BuildStatus& build);
nlohmann::ordered_json to_json(const FolderStatus& status);

}  // namespace q3d::pipeline::status
