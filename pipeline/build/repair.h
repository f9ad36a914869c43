// `verify --repair`: restores damaged files of a finished dataset and of its stages to the same bytes.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/config/build_config.h"
#include "pipeline/run/run_options.h"

namespace q3d::pipeline::build {

struct RepairSummary {
  std::filesystem::path folder;                    // of the dataset
  std::vector<std::string> problems;               // before the repair
  std::vector<std::filesystem::path> quarantined;  // where the damaged files are now
  std::vector<std::filesystem::path> copied;       // files that were restored from another copy
  bool was_built = false;                          // a build made the remaining files again
  std::vector<std::string> unrepaired;             // problems that are left
};

// Checks the dataset and the stages of its output folder, and moves every damaged file to <out>/quarantine,
// where it keeps its path. A file of which an undamaged copy lies in the output folder is linked from there.
// The rest is made again from the sources and from what the stages still hold, if `config` is given: the
// build's own config, in full. Nothing is moved if all files are undamaged. `options.out` is not used.
//
// Throws run::ConfigError if dataset.json says that it was built with another config, and like verify, build
// and manifests::FolderLock.
RepairSummary repair(const std::filesystem::path& given, const std::optional<config::BuildConfig>& config,
                     const run::RunOptions& options);

}  // namespace q3d::pipeline::build
