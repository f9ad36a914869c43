// `--ranks N` of the commands that share their work: N processes (ranks) on this machine, without a launcher
// such as torchrun.
#pragma once

#include <span>

namespace q3d::pipeline::cli {

struct WantedRanks {
  int count = 1;
  bool are_all_needed = false;  // for the whole run, so that they end together
};

// Returns how many ranks the arguments of a command that shares its work ask for: the number of `--ranks`, or
// one for each of the GPUs that `--device` names. It is 1 for help, and for a wrong number, about which the
// command itself complains. `arguments` begins with the command.
WantedRanks wanted_ranks(std::span<char* const> arguments);

// Runs quadruped3d-network with `argv` in `ranks` processes. They meet at a socket of the loopback interface
// that this process has opened. The first rank reads the config before the others start, so that a mistake in
// it is told once. SIGINT, SIGTERM and SIGHUP go on to all ranks, and a pause of this process (SIGTSTP)
// pauses them. If this process is killed, the ranks get SIGTERM. Returns the exit code of rank 0, which
// reports for all, or 128 and the number of the signal that ended it. Returns 2 if another launcher has
// started this process already, and 1 if a process cannot be started.
int run_ranks(char** argv, const WantedRanks& ranks);

}  // namespace q3d::pipeline::cli
