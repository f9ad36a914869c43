// Reads JSON documents from disk. A document is read as a whole or refused.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

namespace q3d::manifests {

// Parses a file. Python writes numbers that JSON does not have: NaN, Infinity and numbers beyond the range of
// double. They are accepted here (see is_beyond_json) and become a record's failure where they are read.
// Throws std::runtime_error that names the file, the byte and line, what was found and what was expected, and
// IoError if the file exists and cannot be read.
nlohmann::json read_json_file(const std::filesystem::path& file);

// Returns the array `key` of a top-level object. Throws std::runtime_error that names the file, what was
// found and what was expected.
const nlohmann::json& array_of(const nlohmann::json& document, const std::string& key,
                               const std::filesystem::path& file);

// Returns whether read_json_file found a number here that JSON cannot hold.
bool is_beyond_json(const nlohmann::json& value);

// Describes a value for people: `the text "abc"`, `3 values`, `null`.
std::string describe(const nlohmann::json& value);

}  // namespace q3d::manifests
