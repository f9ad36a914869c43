// `curate`: takes a large set and a rule, and writes the list of its pictures with the decision about each.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "pipeline/curation/curation_config.h"

namespace q3d::pipeline::curation {

struct CurationSummary {
  std::filesystem::path list;                                            // <out>/<name>.csv
  std::map<std::string, std::map<std::string, std::int64_t>> verdicts;   // split -> verdict -> pictures
  std::map<std::string, std::map<std::string, std::int64_t>> chosen;     // species -> split -> pictures
  std::map<std::string, std::map<std::string, std::int64_t>> available;  // the same, before drawing
  std::map<std::string, std::int64_t> species_not_listed;                // species -> pictures
  std::vector<std::string> notes;
};

// Reads annotation files, but no pictures. Writes <out>/<name>.csv (pipeline/candidates/curation_list.h) and,
// beside it, <name>.json: the rule, the digests of all files read and the counts. Equal files and rule give
// equal bytes. Throws ConfigError, std::runtime_error, Interrupted.
CurationSummary run_curate(const CurationConfig& config, const std::filesystem::path& out);

}  // namespace q3d::pipeline::curation
