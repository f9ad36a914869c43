#include "pipeline/cli/network_program.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <system_error>

#include "pipeline/cli/commands.h"

namespace q3d::pipeline::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char* kName = "quadruped3d-network";
constexpr int kFailure = 1;

// Returns the folder of the running program, also if it was started through a link.
fs::path program_folder() {
  return fs::read_symlink("/proc/self/exe").parent_path();
}

// Returns the path of quadruped3d-network: beside this program in a build folder, or in libexec if installed.
// Empty if it is in neither place.
fs::path find_network_program() {
  const fs::path folder = program_folder();
  for (const fs::path& place : {folder / kName, folder / ".." / "libexec" / "quadruped3d" / kName}) {
    if (fs::exists(place)) return place;
  }
  return {};
}

int start(const fs::path& program, char** argv) {
  if (!waiting_is_decided() && setenv("OMP_WAIT_POLICY", "PASSIVE", /*replace=*/1) != 0) {
    fmt::print(stderr, "quadruped3d: cannot set OMP_WAIT_POLICY: {}\n", std::strerror(errno));
    return kFailure;
  }
  execv(program.c_str(), argv);
  fmt::print(stderr, "quadruped3d: cannot start {}: {}\n", program.string(), std::strerror(errno));
  return kFailure;
}

}  // namespace

bool needs_network(std::span<char* const> arguments) {
  if (arguments.empty()) return false;
  const std::string_view command = arguments.front();
  const auto info = std::find_if(kCommands.begin(), kCommands.end(),
                                 [&](const CommandInfo& each) { return each.name == command; });
  if (info == kCommands.end() || info->needs_network) return info != kCommands.end();
  return !info->network_option.empty() &&
         std::any_of(arguments.begin() + 1, arguments.end(), [&](const char* word) {
           return std::string_view(word).substr(0, std::string_view(word).find('=')) == info->network_option;
         });
}

bool waiting_is_decided() {
  return std::getenv("OMP_WAIT_POLICY") != nullptr || std::getenv("GOMP_SPINCOUNT") != nullptr;
}

int become_network_program(char** argv) {
  const fs::path program = find_network_program();
  if (program.empty()) {
    fmt::print(
        stderr,
        "quadruped3d: {} is missing: expected it in {} or in ../libexec/quadruped3d beside that folder; "
        "build or install the whole project\n",
        kName, program_folder().string());
    return kFailure;
  }
  return start(program, argv);
}

int start_again_passively(char** argv) {
  return start("/proc/self/exe", argv);
}

}  // namespace q3d::pipeline::cli
