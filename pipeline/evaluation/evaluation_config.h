// The configuration of an evaluation: that of a build, and the files of hidden truth. docs/evaluation.md
// explains the keys.
#pragma once

#include <nlohmann/json.hpp>

#include <filesystem>
#include <vector>

#include "pipeline/config/build_config.h"

namespace q3d::pipeline::evaluation {

struct EvaluatedDataset {
  config::DatasetConfig source;
  std::filesystem::path truth;  // hidden truth of a 2D-only set; empty when there is none
  std::filesystem::path masks;  // folder that the truth's mask paths start from; empty: masks are not used
};

struct EvaluationConfig {
  std::vector<EvaluatedDataset> datasets;
  config::NetworkConfig network;
  config::TtaConfig tta;
  std::filesystem::path priors;  // guards.priors, else the checkpoint; read if tta uses priors
  nlohmann::json as_written;     // the merged JSON, paths as the user wrote them
};

// Reads the files in order; a later file's keys replace an earlier one's. Relative paths are relative to the
// file that names them. `checkpoint`, unless empty, replaces network.checkpoint. A build's config can be read
// unchanged: keys that concern only the build are checked and not used. `settings` are single keys on top of
// the files (pipeline/config/config_override.h). Throws ConfigError that names file and key, what was found
// and what was expected.
EvaluationConfig load_evaluation_config(const std::vector<std::filesystem::path>& files,
                                        const std::filesystem::path& checkpoint,
                                        const std::vector<std::string>& settings = {});

}  // namespace q3d::pipeline::evaluation
