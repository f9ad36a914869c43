// The process quadruped3d becomes quadruped3d-network, and OpenMP's threads wait passively in it.
//
// LibTorch's OpenMP threads spin at barriers unless they are told otherwise before their library is loaded.
// On a machine that others use too, the spinning threads take the time that the working ones need: a
// calibration of 5 seconds then takes a minute and a half. So the environment is set before the program with
// LibTorch starts.
#pragma once

#include <span>

namespace q3d::pipeline::cli {

// Returns whether kCommands says that this command line needs the network's program. `arguments` are the
// program's own, without its name.
bool needs_network(std::span<char* const> arguments);

// Makes OpenMP's threads wait passively unless the user's environment says how they wait (OMP_WAIT_POLICY or
// GOMP_SPINCOUNT), and replaces this process by quadruped3d-network with the same arguments. The process
// keeps its id, so signals reach it as before. Returns an exit code only when that fails, after saying why.
int become_network_program(char** argv);

// Returns whether the environment already says how OpenMP's threads wait.
bool waiting_is_decided();

// Starts the running program again with passive waiting; for quadruped3d-network that was started directly.
int start_again_passively(char** argv);

}  // namespace q3d::pipeline::cli
