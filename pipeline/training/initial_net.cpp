#include "pipeline/training/initial_net.h"

#include <fmt/format.h>

#include <stdexcept>
#include <vector>

#include "model/checkpoint.h"
#include "smal/tensors/safetensors.h"

namespace q3d::pipeline::training {
namespace {

// Returns the sizes of the network in `file`, with the switches of the paper's ablations.
model::PrimaConfig initial_config(const smal::tensors::SafeTensors& file,
                                  const std::vector<std::string>& without) {
  model::PrimaConfig config = model::checkpoint_config(file);
  for (const std::string& part : without) {
    if (part == "bio_features") config.learn_bio_encoder = true;
    if (part == "initial_betas") config.betas_from_bio = false;
    if (part == "keypoint_tokens") config.keypoint_tokens = false;
  }
  return config;
}

}  // namespace

std::shared_ptr<model::PrimaNet> initial_net(const settings::TrainingNetworkConfig& network,
                                             const smal::tensors::SmalAsset& asset, torch::Device device) {
  const smal::tensors::SafeTensors file = smal::tensors::SafeTensors::open(network.initial);
  const model::PrimaConfig config = initial_config(file, network.without);
  auto net = model::load_net(file, config, asset, {device, torch::kFloat32});
  if (network.encoders.empty()) return net;
  const at::NoGradGuard no_grad;
  const smal::tensors::SafeTensors encoders = smal::tensors::SafeTensors::open(network.encoders);
  for (auto& parameter : net->named_parameters()) {
    const std::string& name = parameter.key();
    const bool taken = name.starts_with("backbone.") ||
                       (name.starts_with("bioclip_embedding.species_model.") && !config.learn_bio_encoder);
    if (!taken) continue;
    const torch::Tensor stored = encoders.tensor(name);
    if (stored.sizes() != parameter.value().sizes()) {
      throw std::runtime_error(fmt::format("{}: {} has another shape than in {}", network.encoders.string(),
                                           name, network.initial.string()));
    }
    parameter.value().copy_(stored);
  }
  return net;
}

std::map<std::string, std::string> stem_origin(const settings::TrainingNetworkConfig& network) {
  std::map<std::string, std::string> origin;
  const smal::tensors::SafeTensors initial = smal::tensors::SafeTensors::open(network.initial);
  for (const auto& [key, value] : initial.metadata()) {
    if (key.starts_with("stem_")) origin[key] = value;
  }
  return origin;
}

}  // namespace q3d::pipeline::training
