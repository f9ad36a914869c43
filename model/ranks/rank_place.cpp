#include "model/ranks/rank_place.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <stdexcept>

namespace q3d::model::ranks {
namespace {

struct Names {
  const char* rank;
  const char* size;
  const char* local_rank;
  const char* local_size;
};
constexpr Names kTorchrun{"RANK", "WORLD_SIZE", "LOCAL_RANK", "LOCAL_WORLD_SIZE"};
constexpr Names kSlurm{"SLURM_PROCID", "SLURM_NTASKS", "SLURM_LOCALID", "SLURM_STEP_TASKS_PER_NODE"};

int number(const char* name, const char* text, int least, int most) {
  int value = 0;
  const char* end = text + std::strlen(text);
  const auto [stop, error] = std::from_chars(text, end, value);
  if (error == std::errc{} && stop == end && value >= least && value <= most) return value;
  throw std::invalid_argument(
      fmt::format("environment variable {}: got '{}', expected {} to {}", name, text, least, most));
}

int required(const char* name, int least, int most) {
  if (const char* text = std::getenv(name)) return number(name, text, least, most);
  throw std::invalid_argument(fmt::format(
      "environment variable {}: not set, though the others say that this is one of several ranks; start them "
      "with torchrun --no-python, or with srun after exporting MASTER_ADDR and MASTER_PORT",
      name));
}

int optional(const char* name, int least, int most, int otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : number(name, text, least, most);
}

// "4" of torchrun; "4(x2),3" of Slurm, whose first number is that of the first machines.
int ranks_of_machine(const char* name, int most) {
  const char* text = std::getenv(name);
  if (text == nullptr) return optional("SLURM_NTASKS_PER_NODE", 1, most, 1);
  const std::string first(text, std::strcspn(text, "(,"));
  return number(name, first.c_str(), 1, most);
}

// Returns the descriptor that the launcher has left open, which is not for the programs that this one starts.
int own_descriptor(const char* name) {
  const int descriptor = optional(name, 0, std::numeric_limits<int>::max(), -1);
  if (descriptor >= 0) ::fcntl(descriptor, F_SETFD, FD_CLOEXEC);
  return descriptor;
}

RankPlace place(const Names& names) {
  constexpr int kMost = std::numeric_limits<int>::max();
  RankPlace place;
  place.size = required(names.size, 1, kMost);
  if (place.size == 1) return {};
  place.rank = required(names.rank, 0, place.size - 1);
  place.local_rank = optional(names.local_rank, 0, place.size - 1, 0);
  place.local_size = ranks_of_machine(names.local_size, place.size);
  place.master_port = static_cast<std::uint16_t>(required("MASTER_PORT", 1, 65535));
  const char* address = std::getenv("MASTER_ADDR");
  if (address == nullptr || *address == '\0') {
    throw std::invalid_argument(
        "environment variable MASTER_ADDR: not set; expected the host of rank 0, which all ranks can reach");
  }
  place.master_address = address;
  const char* agent = std::getenv("TORCHELASTIC_USE_AGENT_STORE");
  place.launcher_has_store = agent != nullptr && std::strcmp(agent, "True") == 0;
  place.attempt = optional("TORCHELASTIC_RESTART_COUNT", 0, kMost, 0);
  if (place.rank == 0) {
    place.store_socket = own_descriptor("Q3D_STORE_SOCKET");
    place.ready_pipe = own_descriptor("Q3D_READY_PIPE");
  }
  return place;
}

// Cores on which this process may run; 0 if the kernel does not say.
int allowed_cores() {
  cpu_set_t cores;
  return ::sched_getaffinity(0, sizeof(cores), &cores) == 0 ? CPU_COUNT(&cores) : 0;
}

}  // namespace

RankPlace rank_place_from_environment() {
  if (std::getenv(kTorchrun.size) != nullptr) return place(kTorchrun);
  // Only srun numbers a step; sbatch and salloc, which start one process, set the other variables too.
  if (std::getenv("SLURM_STEP_ID") != nullptr && std::getenv(kSlurm.size) != nullptr) return place(kSlurm);
  return {};
}

void tell_launcher(const RankPlace& place) {
  if (place.ready_pipe < 0) return;
  const char word = 1;
  const ssize_t written = ::write(place.ready_pipe, &word, 1);  // a launcher that has ended need not know
  static_cast<void>(written);
  ::close(place.ready_pipe);
}

int own_cores(const RankPlace& place) {
  const int online = std::max(1, static_cast<int>(::sysconf(_SC_NPROCESSORS_ONLN)));
  const int allowed = allowed_cores();
  if (allowed > 0 && allowed < online) return allowed;
  return std::max(1, online / place.local_size);
}

}  // namespace q3d::model::ranks
