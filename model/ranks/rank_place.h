// Reads from the environment which rank the launcher has given to this process.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace q3d::model::ranks {

struct RankPlace {
  int rank = 0;
  int size = 1;
  int local_rank = 0;          // among the ranks of this machine: chooses its GPU
  int local_size = 1;          // ranks of this machine, which share its cores
  std::string master_address;  // where the ranks meet; empty in a world of one
  std::uint16_t master_port = 0;
  bool launcher_has_store = false;  // torchrun's agent listens there; else rank 0 does
  int attempt = 0;                  // how often torchrun has started the ranks again
  // Descriptors that `quadruped3d --ranks` gives to rank 0, else -1: the socket at which its store listens,
  // and a pipe by which it says that the other ranks may start.
  int store_socket = -1;
  int ready_pipe = -1;
  std::chrono::seconds join_timeout{300};    // for all ranks to appear
  std::chrono::seconds answer_timeout{600};  // for a rank that computes
};

// torchrun: RANK, WORLD_SIZE, LOCAL_RANK, LOCAL_WORLD_SIZE, MASTER_ADDR, MASTER_PORT. Slurm's srun:
// SLURM_PROCID, SLURM_NTASKS, SLURM_LOCALID, SLURM_STEP_TASKS_PER_NODE or SLURM_NTASKS_PER_NODE, with
// MASTER_ADDR and MASTER_PORT set by the user. Neither, or one rank: a world of one. Throws
// std::invalid_argument naming the variable, got and expected.
RankPlace rank_place_from_environment();

// Lets the launcher of `quadruped3d --ranks` start the other ranks. Rank 0 calls it once, after it has read
// its config, so that a mistake in the config is told once. Does nothing under another launcher.
void tell_launcher(const RankPlace& place);

// Returns how many cores of this machine belong to the rank, at least 1. A launcher that binds its ranks to
// cores, as srun does, has already divided them; otherwise the ranks of a machine get equal shares.
int own_cores(const RankPlace& place);

}  // namespace q3d::model::ranks
