// Makes a version from finished versions. It has some of their candidates, with their labels.
#pragma once

#include <nlohmann/json.hpp>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/dataset/published_dataset.h"

namespace q3d::pipeline::derived {

// Some candidates of a version.
struct Selection {
  dataset::PublishedDataset dataset;
  std::vector<dataset::VerdictRow> rows;  // in ingest order
};

struct DerivedVersion {
  std::filesystem::path folder;
  dataset::Counts counts;
  std::int64_t shards_linked = 0;   // shards that share their bytes with the version of their origin
  std::int64_t shards_written = 0;  // shards with other rows or another number of rows
  bool was_up_to_date = false;
};

// Writes <out>/<name>-<first 12 hex digits of the key>, where the key is a digest of `how` and of the
// sources' content. Its candidates are those of the selections, in their order; no id may occur twice.
//
// A shard of the first selection of which all rows are selected becomes a hard link, or a copy where the file
// system differs. Every other shard is written anew, with the encoded pictures unchanged. dataset.json is
// written last. It has the sources' configs, and under provenance.derived `how` and the whole provenance of
// each source.
//
// Throws run::ConfigError if the sources have datasets of one name with different roles, terms or thresholds,
// or if nothing is selected, std::runtime_error for sources that cannot be read, and Interrupted.
DerivedVersion write_derived(const std::filesystem::path& out, const std::string& name,
                             const std::string& version, std::vector<Selection> selections,
                             const nlohmann::ordered_json& how);

}  // namespace q3d::pipeline::derived
