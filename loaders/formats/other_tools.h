// Recognises JSON files of another form than the one that a dataset's format reads.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace q3d::loaders::formats {

// Says what a document is if its form is known: whose file, and which format reads it or how to get COCO from
// it. Empty if the form is unknown, or is one that `format` reads.
std::string known_tool(const nlohmann::json& document, const std::string& format);

// Throws std::runtime_error that names the file, and says what known_tool says, if that is not empty.
void refuse_other_form(const nlohmann::json& document, const std::string& format,
                       const std::filesystem::path& file);

}  // namespace q3d::loaders::formats
