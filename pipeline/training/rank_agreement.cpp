#include "pipeline/training/rank_agreement.h"

#include <fmt/format.h>

#include <vector>

#include "pipeline/run/errors.h"

namespace q3d::pipeline::training {

void require_same_run(const model::ranks::Collective& ranks, const std::string& key,
                      const TrainingPosition& position) {
  const auto row = [](const std::vector<std::int64_t>& numbers) {
    return torch::tensor(numbers, torch::kInt64).unsqueeze(0);
  };
  const torch::Tensor keys = ranks.gather(row({key.begin(), key.end()}));
  const torch::Tensor positions = ranks.gather(row({position.phase, position.step}));
  for (std::int64_t rank = 1; rank < ranks.size(); ++rank) {
    if (!torch::equal(keys[rank], keys[0])) {
      throw run::ConfigError(fmt::format(
          "rank {} was started with another configuration, other pools or other assets than rank 0", rank));
    }
    if (!torch::equal(positions[rank], positions[0])) {
      throw run::ConfigError(fmt::format(
          "rank {} does not find the training state that rank 0 finds; --out must be a folder that all ranks "
          "see",
          rank));
    }
  }
}

}  // namespace q3d::pipeline::training
