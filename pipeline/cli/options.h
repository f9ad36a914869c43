// The options that several commands share. Their names, checks and default texts are defined here once; a
// command that means something else by one of them gives its own text.
#pragma once

#include <CLI/App.hpp>

#include <filesystem>
#include <string>
#include <vector>

#include "filters/bootstrap.h"

namespace q3d::pipeline::cli {

// The arguments of a command line that make up a config.
struct ConfigArguments {
  std::vector<std::filesystem::path> files;
  std::vector<std::string> set;  // KEY=VALUE of each --set
  std::string device;            // of --device; empty if it is not given

  // Returns the single keys that the command line sets on top of the files.
  std::vector<std::string> settings() const;
  // Returns the words that give another command the same config.
  std::vector<std::string> words() const;
};

// -c,--config: one or more files that exist, and --set KEY=VALUE. Returns the first, which is not required
// unless the caller says so.
CLI::Option* config_option(
    CLI::App& command, ConfigArguments& config,
    const std::string& text = "JSON config file; keys of a later file replace those of an earlier one");
// --device: the device of the config's network.
CLI::Option* device_option(CLI::App& command, ConfigArguments& config);
// -o,--out is a path. Also adds --no-sync and --no-lock, which say how it is written. Not required unless the
// caller says so.
CLI::Option* out_option(CLI::App& command, std::filesystem::path& out, const std::string& text);
// Adds the same options for a command whose output is one file.
CLI::Option* out_file_option(CLI::App& command, std::filesystem::path& out, const std::string& text);
// -t,--threads: a number, 0 or more.
CLI::Option* threads_option(
    CLI::App& command, int& threads,
    const std::string& text = "number of threads that read and decode pictures (0 = all cores)");
inline constexpr int kMostRanks = 1024;  // of one machine
// --ranks, which `quadruped3d` reads itself before it starts a command (local_ranks.h).
CLI::Option* ranks_option(CLI::App& command);
// --json
CLI::Option* json_flag(CLI::App& command, bool& json,
                       const std::string& text = "print a machine-readable summary to stdout");
// --above-ceiling
CLI::Option* above_ceiling_flag(CLI::App& command, bool& above_ceiling);
// -q,--quiet
CLI::Option* quiet_flag(CLI::App& command, bool& quiet);

// Adds --resamples and --seed of the bootstrap that compares two sets of results, and -o,--out and --json.
void comparison_options(CLI::App& command, filters::BootstrapOptions& bootstrap, std::filesystem::path& out,
                        bool& json);

}  // namespace q3d::pipeline::cli
