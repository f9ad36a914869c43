#include "model/draws.h"

#include <ATen/Context.h>

#include <mutex>

namespace q3d::model {
namespace {

at::Generator generator_of(torch::Device device) {
  return at::globalContext().defaultGenerator(device);
}

torch::Tensor state_of(torch::Device device) {
  at::Generator generator = generator_of(device);
  const std::lock_guard lock(generator.mutex());
  return generator.get_state();
}

void set_state(torch::Device device, const torch::Tensor& state) {
  at::Generator generator = generator_of(device);
  const std::lock_guard lock(generator.mutex());
  generator.set_state(state);
}

}  // namespace

Draws::Draws(torch::Device device) : device_(device), state_(state_of(device)) {}

RepeatedDraws::RepeatedDraws(const Draws& draws) : present_(draws.device_) {
  set_state(draws.device_, draws.state_);
}

RepeatedDraws::~RepeatedDraws() {
  set_state(present_.device_, present_.state_);
}

}  // namespace q3d::model
