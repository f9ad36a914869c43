#include "pipeline/training/loss_watch.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace q3d::pipeline::training {
namespace {

constexpr std::int64_t kTrustedAfter = 50;  // losses; before that the mean is unreliable
constexpr double kMemory = 100.0;           // number of losses that the running mean covers

}  // namespace

std::optional<std::string> LossWatch::check(double loss, double gradient_norm, double divergence_factor) {
  if (!std::isfinite(loss)) return fmt::format("the loss is {}", loss);
  if (!std::isfinite(gradient_norm))
    return fmt::format("the loss is {}, its gradient {}", loss, gradient_norm);
  if (seen >= kTrustedAfter && loss > divergence_factor * mean) {
    return fmt::format("the loss is {}, more than {} times its running mean of {}", loss, divergence_factor,
                       mean);
  }
  ++seen;
  mean += (loss - mean) / std::min(static_cast<double>(seen), kMemory);
  return std::nullopt;
}

}  // namespace q3d::pipeline::training
