// `verify` exists in both programs; only the one that can build also repairs.
#pragma once

#include <functional>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/run/run_options.h"

namespace q3d::pipeline::cli {

struct RepairArguments {
  std::filesystem::path dataset;
  ConfigArguments config;  // without files, only copies are used
  run::RunOptions run;
  bool json = false;
};

// Repairs the dataset, reports what was done and returns the exit code.
using RepairCommand = std::function<int(const RepairArguments&)>;

// Without `repair`, the command runs only without --repair.
Command add_verify_with(CLI::App& app, const RepairCommand& repair);

}  // namespace q3d::pipeline::cli
