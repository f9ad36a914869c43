// Adam's step for parameters that every instance of a batch has separately (0.9, 0.999, 1e-8, no weight
// decay).
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <utility>
#include <vector>

namespace q3d::model {

// The gradient of a parameter (B, ...): its numbers, or for matrices (B, out, in) a sum of outer products of
// rows (B, out) and (B, in).
struct InstanceGradient {
  torch::Tensor dense;
  std::vector<std::pair<torch::Tensor, torch::Tensor>> outer_products;
};

// One parameter of all instances with its moments: tensors of one shape (B, ...).
struct AdamState {
  torch::Tensor parameter, first_moment, second_moment;
};

// Steps the first `steps.size()` instances. steps: each instance's number of steps so far, this one included.
// In float32 on the CPU an outer product is never written out: the step then moves a third less memory, which
// is what bounds it.
void adam_step(const std::vector<AdamState>& states, const std::vector<InstanceGradient>& gradients,
               const std::vector<std::int64_t>& steps, double learning_rate);

}  // namespace q3d::model
