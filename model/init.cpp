// Fresh weights. A seed gives the same bytes on every machine.
#include "model/init.h"

#include <cmath>
#include <string_view>

#include "model/prima.h"
#include "model/seeded_uniform.h"

namespace q3d::model {
namespace {

constexpr double kEmbeddingStd = 0.02;

bool ends_with(std::string_view name, std::string_view end) {
  return name.size() >= end.size() && name.substr(name.size() - end.size()) == end;
}

bool contains(std::string_view name, std::string_view part) {
  return name.find(part) != std::string_view::npos;
}

bool is_layer_norm(std::string_view name) {
  return contains(name, "norm") || contains(name, ".ln_") || contains(name, "projection.1.") ||
         contains(name, "param_to_token.1.");
}

bool is_embedding(std::string_view name) {
  return contains(name, "embed") && (ends_with(name, "pos_embed") || ends_with(name, "_embedding") ||
                                     ends_with(name, "_embeddings.weight"));
}

// The spread of a tensor that is neither constant nor a layer norm. Embeddings have the official standard
// deviation; matrices the fan-in rule of torch.nn.Linear, and biases none.
double uniform_bound(const TensorSpec& spec) {
  if (is_embedding(spec.name)) return std::sqrt(3.0) * kEmbeddingStd;
  if (spec.shape.size() < 2) return 0.0;
  double fan_in = 1.0;
  for (std::size_t i = 1; i < spec.shape.size(); ++i) fan_in *= static_cast<double>(spec.shape[i]);
  // CLIP multiplies by its last projection from the left, so its rows are the inputs.
  if (ends_with(spec.name, "visual.proj")) fan_in = static_cast<double>(spec.shape[0]);
  return 1.0 / std::sqrt(fan_in);
}

}  // namespace

torch::Tensor initial_tensor(const TensorSpec& spec, std::uint64_t seed) {
  if (ends_with(spec.name, "init_pose")) {  // the identity, 35 times: columns (1, 0, 0) and (0, 1, 0)
    return torch::tensor({1.0F, 0.0F, 0.0F, 0.0F, 1.0F, 0.0F}).repeat({1, kPose6d / 6});
  }
  if (ends_with(spec.name, "init_cam")) return torch::tensor({{0.9F, 0.0F, 0.0F}});
  if (is_layer_norm(spec.name)) {
    return ends_with(spec.name, ".weight") ? torch::ones(spec.shape) : torch::zeros(spec.shape);
  }
  torch::Tensor tensor = torch::empty(spec.shape);
  fill_uniform(tensor, uniform_bound(spec), seed, spec.name);
  return tensor;
}

void initialise(PrimaNet& net, std::uint64_t seed) {
  const torch::NoGradGuard no_grad;
  for (auto& parameter : net.named_parameters()) {
    parameter.value().copy_(initial_tensor({parameter.key(), parameter.value().sizes().vec()}, seed));
  }
}

void write_initial_checkpoint(const std::filesystem::path& path, const PrimaConfig& config,
                              std::uint64_t seed, torch::ScalarType dtype) {
  smal::NamedTensors tensors;
  for (const TensorSpec& spec : expected_tensors(config)) {
    tensors.emplace_back(spec.name, initial_tensor(spec, seed).to(dtype));
  }
  write_checkpoint(path, config, tensors);
}

}  // namespace q3d::model
