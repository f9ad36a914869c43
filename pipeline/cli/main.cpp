// quadruped3d: the program that people start. It runs the commands that need no network itself, so that they
// start at once; the others run in quadruped3d-network, which links LibTorch.

#include <span>
#include <string_view>

#include "pipeline/cli/local_ranks.h"
#include "pipeline/cli/network_program.h"
#include "pipeline/cli/plain_commands.h"
#include "pipeline/cli/program.h"

int main(int argc, char** argv) {
  namespace cli = q3d::pipeline::cli;
  // The program that runs a command also answers `help COMMAND`.
  const std::size_t command = argc > 2 && std::string_view(argv[1]) == "help" ? 2 : 1;
  const auto words = std::span(argv, static_cast<std::size_t>(argc));
  if (words.size() > command && cli::needs_network(words.subspan(command))) {
    const cli::WantedRanks ranks = cli::wanted_ranks(words.subspan(command));
    return ranks.count > 1 ? cli::run_ranks(argv, ranks) : cli::become_network_program(argv);
  }
  return cli::run_program(argc, argv, cli::kPlainCommands);
}
