// quadruped3d-network: the commands that need LibTorch, and the completions and the manual page of all
// commands. quadruped3d starts it.

#include <vector>

#include "pipeline/cli/network_program.h"
#include "pipeline/cli/plain_commands.h"
#include "pipeline/cli/program.h"

int main(int argc, char** argv) {
  namespace cli = q3d::pipeline::cli;
  if (!cli::waiting_is_decided()) return cli::start_again_passively(argv);
  // `verify` and `inspect` come before the plain commands of these names, which do not repair and draw no
  // sheets.
  std::vector<cli::CommandEntry> entries{
      {"build", cli::add_build},
      {"calibrate", cli::add_calibrate},
      {"predict", cli::add_predict},
      {"verify", cli::add_verify_with_repair},
      {"inspect", cli::add_inspect_with_sheets},
      {"overlay", cli::add_overlay},
      {"report", cli::add_report},
      {"sample", cli::add_sample},
      {"init", cli::add_init},
      {"train", cli::add_train},
      {"evaluate", cli::add_evaluate},
      {"compare", cli::add_compare},
      {"evaluate-labels", cli::add_evaluate_labels},
      {"compare-labels", cli::add_compare_labels},
      {"completion", cli::add_completion},
      {"man", cli::add_man},
  };
  entries.insert(entries.end(), cli::kPlainCommands.begin(), cli::kPlainCommands.end());
  return cli::run_program(argc, argv, entries);
}
