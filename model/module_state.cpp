#include "model/module_state.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <stdexcept>

namespace q3d::model {
namespace {

std::string describe(const torch::Tensor& tensor) {
  return fmt::format("[{}] {}", fmt::join(tensor.sizes(), ", "), torch::toString(tensor.scalar_type()));
}

}  // namespace

void append_parameters(smal::tensors::NamedTensors& state, const std::string& prefix,
                       const torch::nn::Module& module) {
  for (const auto& parameter : module.named_parameters()) {
    state.emplace_back(prefix + parameter.key(),
                       parameter.value().detach().to(torch::kCPU, /*non_blocking=*/false, /*copy=*/true));
  }
}

torch::Tensor restored_like(const smal::tensors::SafeTensors& file, const std::string& name,
                            const torch::Tensor& like) {
  const torch::Tensor stored = file.tensor(name);
  if (stored.sizes() != like.sizes() || stored.scalar_type() != like.scalar_type()) {
    throw std::runtime_error(fmt::format("{}: {}: got {}, expected {}", file.path().string(), name,
                                         describe(stored), describe(like)));
  }
  return stored.to(like.device(), /*non_blocking=*/false, /*copy=*/true);
}

void restore_parameters(const smal::tensors::SafeTensors& file, const std::string& prefix,
                        torch::nn::Module& module) {
  const at::NoGradGuard no_grad;
  for (auto& parameter : module.named_parameters()) {
    parameter.value().copy_(restored_like(file, prefix + parameter.key(), parameter.value()));
  }
}

}  // namespace q3d::model
