// Prints the messages of `build` about a finished dataset, a run that stopped after a stage, and a dry run.
#pragma once

#include <nlohmann/json.hpp>

#include <string>
#include <vector>

#include "pipeline/build/build.h"
#include "pipeline/build/dry_run.h"

namespace q3d::pipeline::cli {

// Prints to stderr the counts, the quality, the dataset's folder, and the commands that come next.
void print_summary(const build::BuildSummary& summary);
nlohmann::ordered_json to_json(const build::BuildSummary& summary);

// Prints to stderr, for a summary with `stopped_after`, which results exist and the command that continues.
void print_stop(const build::BuildSummary& summary, const std::filesystem::path& out);
nlohmann::ordered_json stop_json(const build::BuildSummary& summary, const std::filesystem::path& out);

std::string page(const build::DryRun& forecast);
nlohmann::ordered_json to_json(const build::DryRun& forecast);

}  // namespace q3d::pipeline::cli
