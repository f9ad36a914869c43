// Reads and writes network weights as safetensors under the official names. The sizes are in the file's
// metadata, as JSON under "prima_config".
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "model/config.h"
#include "model/layers.h"
#include "model/net.h"
#include "smal/tensors/asset.h"
#include "smal/tensors/safetensors.h"

namespace q3d::model {

struct TensorSpec {
  std::string name;
  std::vector<std::int64_t> shape;
  bool operator==(const TensorSpec&) const = default;
};

// Returns the specification of every tensor of the network in the module's order, without allocating any.
std::vector<TensorSpec> expected_tensors(const PrimaConfig& config);

// Returns whether a checkpoint may hold this tensor although the network does not: CLIP's text tower,
// discriminator.*, the priors, `initialized`, smal.* and training.*, the state of a training run.
bool is_allowed_extra(const std::string& name);

// Returns the config in the file's metadata. Throws std::runtime_error if it is absent or not valid.
PrimaConfig checkpoint_config(const smal::tensors::SafeTensors& file);

// Builds the network and copies the weights in, casting float16 and bfloat16 files. Strict: throws
// std::runtime_error that names every missing, extra, wrong-shaped or wrongly typed tensor; smal.* must have
// the asset's shapes. There are never two full copies in memory.
std::shared_ptr<PrimaNet> load_net(const smal::tensors::SafeTensors& file, const PrimaConfig& config,
                                   const smal::tensors::SmalAsset& asset, const Placement& placement);

// Writes the tensors, with the config and the given further entries in the metadata. Throws
// std::runtime_error.
void write_checkpoint(const std::filesystem::path& path, const PrimaConfig& config,
                      const smal::tensors::NamedTensors& tensors,
                      const std::map<std::string, std::string>& more_metadata = {});

}  // namespace q3d::model
