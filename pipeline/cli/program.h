// The part that both programs share: the command line, the commands' names and the exit codes.
#pragma once

#include <span>

#include "pipeline/cli/commands.h"

namespace q3d::pipeline::cli {

struct CommandEntry {
  std::string_view name;
  Command (*add)(CLI::App& app);
};

// Parses the command line, runs the chosen command and turns exceptions into exit codes: 0 success, 1 a
// failure at run time, 2 wrong usage or configuration, 130, 143 or 129 stopped by SIGINT, SIGTERM or SIGHUP.
// Commands of kCommands that `entries` lacks appear only in the help.
int run_program(int argc, char** argv, std::span<const CommandEntry> entries);

}  // namespace q3d::pipeline::cli
