// Recognises JSON files of another form than the one that a dataset's format reads.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace q3d::loaders::formats {

// Says what a document is if its form is known: the tool that wrote it, and the format that reads it or how
// to convert it to COCO. Returns "" if the form is unknown, or is one that `format` reads.
std::string known_tool(const nlohmann::json& document, const std::string& format);

// Throws std::runtime_error with the file's name and the text of known_tool(), unless that text is empty.
void refuse_other_form(const nlohmann::json& document, const std::string& format,
                       const std::filesystem::path& file);

}  // namespace q3d::loaders::formats
