#include "model/ranks/rank_place.h"

#include <fmt/format.h>

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
constexpr Names kSlurm{"SLURM_PROCID", "SLURM_NTASKS", "SLURM_LOCALID", "SLURM_NTASKS_PER_NODE"};

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

RankPlace place(const Names& names) {
  constexpr int kMost = std::numeric_limits<int>::max();
  RankPlace place;
  place.size = required(names.size, 1, kMost);
  if (place.size == 1) return {};
  place.rank = required(names.rank, 0, place.size - 1);
  place.local_rank = optional(names.local_rank, 0, place.size - 1, 0);
  place.local_size = optional(names.local_size, 1, place.size, 1);
  place.master_port = static_cast<std::uint16_t>(required("MASTER_PORT", 1, 65535));
  const char* address = std::getenv("MASTER_ADDR");
  if (address == nullptr || *address == '\0') {
    throw std::invalid_argument(
        "environment variable MASTER_ADDR: not set; expected the host of rank 0, which all ranks can reach");
  }
  place.master_address = address;
  const char* agent = std::getenv("TORCHELASTIC_USE_AGENT_STORE");
  place.launcher_has_store = agent != nullptr && std::strcmp(agent, "True") == 0;
  return place;
}

}  // namespace

RankPlace rank_place_from_environment() {
  if (std::getenv(kTorchrun.size) != nullptr) return place(kTorchrun);
  // Only srun numbers a step; sbatch and salloc, which start one process, set the other variables too.
  if (std::getenv("SLURM_STEP_ID") != nullptr && std::getenv(kSlurm.size) != nullptr) return place(kSlurm);
  return {};
}

}  // namespace q3d::model::ranks
