#include "pipeline/cli/program.h"

#include <fmt/format.h>

#include <opencv2/core.hpp>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "manifests/file_descriptor.h"
#include "pipeline/cli/standard_streams.h"
#include "pipeline/cli/stderr_log.h"
#include "pipeline/cli/usage.h"
#include "pipeline/run/errors.h"
#include "pipeline/run/interrupt.h"
#include "pipeline/run/version.h"

namespace q3d::pipeline::cli {
namespace {

constexpr int kFailure = 1;
constexpr int kUsage = 2;

// Returns advice on what a person can do about an errno.
const char* advice(int code) {
  switch (code) {
    case EACCES:
    case EPERM:
      return " (give this user permission for it)";
    case EMFILE:
    case ENFILE:
      return " (raise the limit of open files, `ulimit -n`)";
    case EINVAL:  // the message itself says what to do
    case ELOOP:
    case ENOLCK:
    case ENOSYS:
    case ENOTSUP:
      return "";
    case ENOMEM:
      return " (free some memory)";
    case ENOSPC:
    case EDQUOT:
      return " (free some disk space)";
    default:
      return " (check the disk or the network mount)";
  }
}

// Adds every command in the order of kCommands. Returns those that this program can run.
std::vector<std::pair<std::string, Command>> add_commands(CLI::App& app,
                                                          std::span<const CommandEntry> entries) {
  std::vector<std::pair<std::string, Command>> commands;
  for (const CommandInfo& info : kCommands) {
    const auto entry = std::find_if(entries.begin(), entries.end(), [&](const CommandEntry& candidate) {
      return candidate.name == info.name;
    });
    if (entry == entries.end()) {
      declare(app, info.name);
    } else {
      commands.emplace_back(info.name, entry->add(app));
    }
  }
  return commands;
}

// Returns false for a rank that --ranks or torchrun has started, except for rank 0, which speaks for all.
bool speaks_for_all() {
  const char* rank = std::getenv("RANK");
  return rank == nullptr || std::getenv("WORLD_SIZE") == nullptr || std::string_view(rank) == "0";
}

int parse_and_run(std::vector<std::string> words, std::span<const CommandEntry> entries) {
  CLI::App app{
      "Builds 3D datasets of quadrupeds: it adds pseudo-3D labels (SMAL pose, shape, camera) to photographs\n"
      "that have 2D keypoints, and records for every label how it was made and why it was kept or dropped."};
  app.name("quadruped3d");
  app.require_subcommand(1);
  app.set_version_flag("--version", "quadruped3d " + std::string(run::version()));
  app.footer(
      "First steps:\n"
      "  quadruped3d sample --out data/world                 render pictures to try the program with\n"
      "  quadruped3d init --size small --out data/small.safetensors\n"
      "  quadruped3d calibrate --config configs/sample.json --out out --write out/thresholds.json\n"
      "  quadruped3d build --config configs/sample.json --config out/thresholds.json --out out\n"
      "  quadruped3d verify out\n"
      "  quadruped3d report out\n"
      "`quadruped3d help COMMAND` explains a command with examples.");
  const auto commands = add_commands(app, entries);
  try {
    std::reverse(words.begin(), words.end());
    words.pop_back();  // the program's name
    app.parse(std::move(words));
  } catch (const CLI::Success& request) {
    return app.exit(request);
  } catch (const CLI::ParseError& error) {
    fmt::print(stderr, "{}", usage_message(app, error));
    return kUsage;
  }
  for (const auto& [name, command] : commands) {
    if (app.got_subcommand(name)) return command();
  }
  return kUsage;
}

}  // namespace

CLI::App* declare(CLI::App& app, std::string_view name) {
  for (const CommandInfo& info : kCommands) {
    if (info.name == name) return app.add_subcommand(std::string(name), std::string(info.description));
  }
  throw std::logic_error("no such command: " + std::string(name));
}

int run_program(int argc, char** argv, std::span<const CommandEntry> entries) {
  prepare_standard_streams();
  cv::setNumThreads(1);  // the flow graph's threads are the only ones
  const bool speaks = speaks_for_all();
  run::install_interrupt_handlers(/*quiet=*/!speaks);
  const std::vector<std::string> words = with_help_expanded({argv, argv + argc});
  if (const auto problem = unknown_command(words)) {
    fmt::print(stderr, "{}", *problem);
    return kUsage;
  }
  StderrLog log;
  const run::LogTo to_stderr(log);
  try {
    const int code = parse_and_run(words, entries);
    finish_stdout();
    return code;
  } catch (const run::Interrupted&) {
    if (speaks) fmt::print(stderr, "stopped; run the same command to continue\n");
    return run::interrupt_exit_code();
  } catch (const run::ConfigError& error) {
    fmt::print(stderr, "quadruped3d: {}\n", error.what());
    return kUsage;
  } catch (const manifests::IoError& error) {
    if (error.names_no_file()) {
      fmt::print(stderr, "quadruped3d: {}\n", error.what());
    } else {
      fmt::print(stderr, "quadruped3d: {}{}; nothing was recorded for it; run the same command again\n",
                 error.what(), advice(error.code()));
    }
    return kFailure;
  } catch (const std::bad_alloc&) {
    fmt::print(stderr,
               "quadruped3d: out of memory; use a smaller network.batch, tta.batch or shards.unit_size\n");
    return kFailure;
  } catch (const std::system_error& error) {  // fmt::print throws it too
    const std::string told = stdout_failed() ? unwritten_stdout(error.code().message()) : error.what();
    fmt::print(stderr, "quadruped3d: {}\n", told);
    return kFailure;
  } catch (const std::exception& error) {
    fmt::print(stderr, "quadruped3d: {}\n", error.what());
    return kFailure;
  }
}

}  // namespace q3d::pipeline::cli
