// `leakage`: compares the pool of a config with its test sets and with itself, and writes lists and a page.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "pipeline/config/build_config.h"
#include "pipeline/run/run_options.h"

namespace q3d::pipeline::leakage {

struct LeakageRunSummary {
  std::size_t candidates = 0;
  std::size_t pool_pictures = 0;
  std::size_t test_pictures = 0;
  std::map<std::string, std::size_t> leaks_by_evidence;  // candidates
  std::size_t groups = 0;
  std::size_t pictures_in_groups = 0;
  std::vector<std::string> notes;
  double seconds = 0.0;
};

// Needs no network. Writes leaks.csv, duplicates.csv, leakage.json and leakage.html into the output folder.
// Throws ConfigError, std::runtime_error, Interrupted.
LeakageRunSummary run_leakage(const config::BuildConfig& config, const run::RunOptions& options);

}  // namespace q3d::pipeline::leakage
