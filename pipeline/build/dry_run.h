// Predicts what a build would make and what it would use again. It writes nothing.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/config/build_config.h"
#include "pipeline/run/run_options.h"
#include "pipeline/stages/stage.h"

namespace q3d::pipeline::build {

// The forecast for one stage that has a folder.
struct StageForecast {
  stages::Stage stage = stages::Stage::predict;
  std::string key;               // 64 hex digits
  std::filesystem::path folder;  // relative to the output folder; it need not exist
  std::int64_t reused = 0;       // units
  std::int64_t made = 0;  // units; for `crops`, those that get a table if one of their candidates is kept
  std::int64_t not_needed = 0;   // units without stored crops that have their shard
  std::vector<std::string> why;  // reasons why units are made: sentences without a full stop
};

struct DryRun {
  std::string version;  // "<name>-<first 12 hex digits of the key>"
  std::int64_t candidates = 0;
  std::int64_t units = 0;
  bool is_up_to_date = false;  // the finished dataset exists and is undamaged: nothing would be made
  std::vector<StageForecast> stages;
};

// Reads the datasets, digests every picture and compares every file of the stages with its journal, as a
// build does, and writes nothing: no output folder, no lock, no cache. Throws like build().
DryRun dry_run(const config::BuildConfig& config, const run::RunOptions& options);

}  // namespace q3d::pipeline::build
