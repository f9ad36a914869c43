// JSON documents from disk: whole or refused.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

namespace q3d::manifests {

// Parses a file. NaN, Infinity and numbers beyond the range of double, which Python writes and JSON does not
// know, are let pass here (see is_beyond_json) and become a record's failure where they are read. Throws
// std::runtime_error naming the file, the byte and line, got and expected.
nlohmann::json read_json_file(const std::filesystem::path& file);

// The array `key` of a top-level object. Throws std::runtime_error naming file, got and expected.
const nlohmann::json& array_of(const nlohmann::json& document, const std::string& key,
                               const std::filesystem::path& file);

// Whether read_json_file found a number here that JSON cannot hold.
bool is_beyond_json(const nlohmann::json& value);

// What a value is, for people: `the text "abc"`, `3 values`, `null`.
std::string describe(const nlohmann::json& value);

}  // namespace q3d::manifests
