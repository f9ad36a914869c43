// Reads JSON documents that are one long list, element by element.
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>

namespace q3d::manifests {

// Reads a file like read_json_file, and gives `take` every element of the array `key` of the top-level object
// in order, so that no more than one of them lies in memory. Returns the document, in which that array is
// empty. The elements may come before the text turns out to be damaged: then this throws what read_json_file
// throws.
nlohmann::json read_json_elements(const std::filesystem::path& file, const std::string& key,
                                  const std::function<void(nlohmann::json&&)>& take);

}  // namespace q3d::manifests
