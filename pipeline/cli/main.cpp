// quadruped3d: the program that people start. It runs the commands that need no network itself, so that they
// start at once; the others run in quadruped3d-network, which links LibTorch.

#include <array>

#include "pipeline/cli/network_program.h"
#include "pipeline/cli/program.h"

int main(int argc, char** argv) {
  namespace cli = q3d::pipeline::cli;
  if (argc > 1 && cli::needs_network(argv[1])) return cli::become_network_program(argv);
  constexpr std::array<cli::CommandEntry, 6> kEntries{{
      {"verify", cli::add_verify},
      {"inspect", cli::add_inspect},
      {"config", cli::add_config},
      {"explain", cli::add_explain},
      {"leakage", cli::add_leakage},
      {"curate", cli::add_curate},
  }};
  return cli::run_program(argc, argv, kEntries);
}
