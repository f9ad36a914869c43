#include "model/learner.h"

namespace q3d::model {

std::vector<double> to_host(const std::vector<torch::Tensor>& scalars) {
  const torch::Tensor values = torch::stack(scalars).detach().to(torch::kCPU, torch::kFloat64).contiguous();
  return {values.data_ptr<double>(), values.data_ptr<double>() + values.numel()};
}

}  // namespace q3d::model
