// A config with nothing left unsaid: profile expanded, defaults filled in.
#pragma once

#include <nlohmann/json.hpp>

#include "pipeline/config/build_config.h"

namespace q3d::pipeline::config {

// Every key of docs/config.md with its value; read as a config again, it gives the same one. Keys without a
// default that the config does not give (thresholds, network) are left out. Paths are absolute.
nlohmann::ordered_json effective_config(const BuildConfig& config);

// The guards alone, every key.
nlohmann::ordered_json effective_guards(const GuardConfig& guards);

}  // namespace q3d::pipeline::config
