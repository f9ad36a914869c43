#include "model/module_state.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <mutex>
#include <stdexcept>
#include <vector>

namespace q3d::model {
namespace {

std::string describe(const torch::Tensor& tensor) {
  return fmt::format("[{}] {}", fmt::join(tensor.sizes(), ", "), torch::toString(tensor.scalar_type()));
}

// The CPU's generator, and that of a CUDA device.
std::vector<std::pair<std::string, torch::Device>> generators(torch::Device device) {
  std::vector<std::pair<std::string, torch::Device>> list{{"cpu", torch::kCPU}};
  if (!device.is_cpu()) list.emplace_back("device", device);
  return list;
}

}  // namespace

void append_parameters(smal::NamedTensors& state, const std::string& prefix,
                       const torch::nn::Module& module) {
  for (const auto& parameter : module.named_parameters()) {
    state.emplace_back(prefix + parameter.key(),
                       parameter.value().detach().to(torch::kCPU, /*non_blocking=*/false, /*copy=*/true));
  }
}

torch::Tensor restored_like(const smal::SafeTensors& file, const std::string& name,
                            const torch::Tensor& like) {
  const torch::Tensor stored = file.tensor(name);
  if (stored.sizes() != like.sizes() || stored.scalar_type() != like.scalar_type()) {
    throw std::runtime_error(fmt::format("{}: {}: got {}, expected {}", file.path().string(), name,
                                         describe(stored), describe(like)));
  }
  return stored.to(like.device(), /*non_blocking=*/false, /*copy=*/true);
}

void restore_parameters(const smal::SafeTensors& file, const std::string& prefix, torch::nn::Module& module) {
  const torch::NoGradGuard no_grad;
  for (auto& parameter : module.named_parameters()) {
    parameter.value().copy_(restored_like(file, prefix + parameter.key(), parameter.value()));
  }
}

void append_generators(smal::NamedTensors& state, const std::string& prefix, torch::Device device) {
  for (const auto& [name, where] : generators(device)) {
    at::Generator generator = at::globalContext().defaultGenerator(where);
    const std::lock_guard lock(generator.mutex());
    state.emplace_back(prefix + name, generator.get_state().clone());
  }
}

void restore_generators(const smal::SafeTensors& file, const std::string& prefix, torch::Device device) {
  for (const auto& [name, where] : generators(device)) {
    at::Generator generator = at::globalContext().defaultGenerator(where);
    const std::lock_guard lock(generator.mutex());
    generator.set_state(restored_like(file, prefix + name, generator.get_state()));
  }
}

}  // namespace q3d::model
