// Notices when training goes wrong.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace q3d::pipeline::training {

// Compares each loss with the running mean of the earlier ones. It is part of a run's state.
struct LossWatch {
  double mean = 0.0;
  std::int64_t seen = 0;

  // Returns what is wrong with the loss of a step. If nothing is wrong, the loss joins the mean.
  std::optional<std::string> check(double loss, double gradient_norm, double divergence_factor);
};

}  // namespace q3d::pipeline::training
