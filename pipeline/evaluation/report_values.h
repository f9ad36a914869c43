// Formats values as reports show them.
#pragma once

#include <nlohmann/json.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace q3d::pipeline::evaluation {

// Returns the shortest text that reads back as the same number; empty for no value.
std::string number_text(const std::optional<double>& value);
nlohmann::ordered_json number_or_null(const std::optional<double>& value);

// Returns what AUC and PCK of `samples` were divided by: "mask", "crop", "mask and crop", or "" without
// samples.
std::string normaliser_name(std::int64_t by_mask, std::int64_t samples);

}  // namespace q3d::pipeline::evaluation
