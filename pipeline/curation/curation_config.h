// The configuration of `curate`: the whole set and the rule. docs/datasets.md explains the keys.
#pragma once

#include <nlohmann/json.hpp>

#include <filesystem>
#include <string>
#include <vector>

#include "loaders/curation/curation.h"
#include "pipeline/config/build_config.h"

namespace q3d::pipeline::curation {

// A sub-dataset's own annotation files. They give species and videos that its pictures' names do not tell.
struct CurationSource {
  std::string source;  // as in the set's `source_dataset`; case, '-' and '_' do not matter
  std::vector<std::filesystem::path> annotations;
};

struct CurationConfig {
  std::string name = "curation";                // of the list's file
  std::vector<config::DatasetConfig> datasets;  // one for each split
  std::vector<CurationSource> sources;
  std::vector<std::string> videos;  // sub-datasets whose pictures are frames of videos, spelled as above
  loaders::curation::CurationRule rule;
  nlohmann::json as_written;  // the merged JSON, paths as the user wrote them
};

// Reads the files in order; a later file's keys replace an earlier one's. Relative paths are relative to the
// file that names them. `settings` are single keys on top of the files (pipeline/config/config_override.h).
// Throws ConfigError that names file and key, what was found and what was expected.
CurationConfig load_curation_config(const std::vector<std::filesystem::path>& files,
                                    const std::vector<std::string>& settings = {});

// Checks and converts merged JSON; `where` names it in messages.
CurationConfig parse_curation_config(const nlohmann::json& json, const std::string& where);

}  // namespace q3d::pipeline::curation
