// Finds the finished dataset of an output folder that a config has built, without reading its candidates.
#pragma once

#include <filesystem>
#include <string>

#include "pipeline/config/build_config.h"
#include "pipeline/stages/stages.h"

namespace q3d::pipeline::evaluation {

struct BuiltVersion {
  std::filesystem::path folder;
  std::string content_id;
};

// Returns the finished dataset below `out` that was built with these keys (stages::keys_of_config) and with
// the config's version, datasets, veto list and test sets. If there are several, because pictures were added
// between builds, it returns the one to which `latest` points. Throws std::runtime_error if there is none, or
// if `latest` points to none of several.
BuiltVersion find_built_version(const config::BuildConfig& config, const stages::StageKeys& keys,
                                const std::filesystem::path& out);

}  // namespace q3d::pipeline::evaluation
