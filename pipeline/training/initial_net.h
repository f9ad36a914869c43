// The network from which a training starts.
#pragma once

#include <torch/types.h>

#include <map>
#include <memory>
#include <string>

#include "model/net.h"
#include "pipeline/training/settings/training_config.h"
#include "smal/tensors/asset.h"

namespace q3d::pipeline::training {

// Returns the network of the initial checkpoint with the switches of the config's ablations, and with the
// encoders of another checkpoint if the config names one. A network that learns its bio encoder from random
// weights takes only the backbone from that checkpoint. Throws std::runtime_error that names the file and the
// tensor that does not fit.
std::shared_ptr<model::PrimaNet> initial_net(const settings::TrainingNetworkConfig& network,
                                             const smal::tensors::SmalAsset& asset, torch::Device device);

// Returns origin and licence of a pre-trained stem from the initial checkpoint's metadata.
std::map<std::string, std::string> stem_origin(const settings::TrainingNetworkConfig& network);

}  // namespace q3d::pipeline::training
