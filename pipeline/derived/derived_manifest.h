// Makes dataset.json and verdicts.csv of a version that is made from other versions.
#pragma once

#include <nlohmann/json.hpp>

#include <string>
#include <vector>

#include "pipeline/derived/derived_version.h"

namespace q3d::pipeline::derived {

// Returns dataset.json without name, version, key, content_id, verdicts and shards. Counts and statistics
// cover the selected rows. Throws run::ConfigError if the sources do not fit each other.
nlohmann::ordered_json derived_manifest(const std::vector<Selection>& selections,
                                        const nlohmann::ordered_json& how);

// Returns verdicts.csv of the selected rows, in the form in which `build` writes it.
std::string derived_verdicts(const std::vector<Selection>& selections);

}  // namespace q3d::pipeline::derived
