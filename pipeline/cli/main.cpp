// quadruped3d: the program that people start. It runs the commands that need no network itself, so that they
// start at once; the others run in quadruped3d-network, which links LibTorch.

#include <array>
#include <span>
#include <string_view>

#include "pipeline/cli/network_program.h"
#include "pipeline/cli/program.h"

int main(int argc, char** argv) {
  namespace cli = q3d::pipeline::cli;
  // `help COMMAND` is answered where the command is.
  const std::size_t command = argc > 2 && std::string_view(argv[1]) == "help" ? 2 : 1;
  const auto words = std::span(argv, static_cast<std::size_t>(argc));
  if (words.size() > command && cli::needs_network(words.subspan(command))) {
    return cli::become_network_program(argv);
  }
  constexpr std::array<cli::CommandEntry, 13> kEntries{{
      {"verify", cli::add_verify},
      {"status", cli::add_status},
      {"inspect", cli::add_inspect},
      {"config", cli::add_config},
      {"explain", cli::add_explain},
      {"leakage", cli::add_leakage},
      {"curate", cli::add_curate},
      {"topology", cli::add_topology},
      {"export", cli::add_export},
      {"corrections", cli::add_corrections},
      {"merge", cli::add_merge},
      {"subset", cli::add_subset},
      {"diff", cli::add_diff},
  }};
  return cli::run_program(argc, argv, kEntries);
}
