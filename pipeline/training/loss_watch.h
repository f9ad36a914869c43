// Notices when training goes wrong.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace q3d::pipeline::training {

// Compares each loss with the running mean of those before it. Part of a run's state.
struct LossWatch {
  double mean = 0.0;
  std::int64_t seen = 0;

  // What is wrong with the loss of a step, or nothing; then the loss joins the mean.
  std::optional<std::string> check(double loss, double gradient_norm, double divergence_factor);
};

}  // namespace q3d::pipeline::training
