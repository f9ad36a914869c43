// dataset.json and verdicts.csv of a version that is made from others.
#pragma once

#include <nlohmann/json.hpp>

#include <string>
#include <vector>

#include "pipeline/derived/derived_version.h"

namespace q3d::pipeline::derived {

// dataset.json without name, version, key, content_id, verdicts and shards. Counts and statistics are those
// of the selected rows. Throws run::ConfigError if the sources do not fit each other.
nlohmann::ordered_json derived_manifest(const std::vector<Selection>& selections,
                                        const nlohmann::ordered_json& how);

// verdicts.csv of the selected rows, as `build` writes it.
std::string derived_verdicts(const std::vector<Selection>& selections);

}  // namespace q3d::pipeline::derived
