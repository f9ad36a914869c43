// The effective config, in which the profile is expanded and defaults are filled in.
#pragma once

#include <nlohmann/json.hpp>

#include "pipeline/config/build_config.h"

namespace q3d::pipeline::config {

// Returns every key of docs/config.md with its value. Reading the result gives the same config. Keys without
// a default that the config does not give (thresholds, network) are left out. Paths are absolute.
nlohmann::ordered_json effective_config(const BuildConfig& config);

// Returns every key of the guards alone.
nlohmann::ordered_json effective_guards(const GuardConfig& guards);

}  // namespace q3d::pipeline::config
