// The whole network as one torch module, with the official checkpoint's parameter names. It starts in
// training mode, like every torch module; Prima::load returns a frozen one in evaluation mode.
#pragma once

#include <torch/nn/module.h>
#include <torch/types.h>

#include <memory>

#include "model/bioclip.h"
#include "model/config.h"
#include "model/decoder.h"
#include "model/layers.h"
#include "model/prima.h"
#include "model/vit.h"

namespace q3d::model {

class PrimaNet : public torch::nn::Module {
 public:
  // Weights are uninitialised; on torch::kMeta they have shapes only.
  explicit PrimaNet(const PrimaConfig& config, const Placement& placement = {});

  // images (B, 3, 256, 256) float32, normalised. Gradients flow if they are enabled.
  ImageFeatures encode(const torch::Tensor& images, const Observer& observe = {}) const;

  // images as above -> (B, 192, embed_dim): the backbone on the crop's middle columns alone.
  torch::Tensor image_tokens(const torch::Tensor& images, const Observer& observe = {}) const;

  // Packs the matrices that nothing changes any more, where packs_matrices says so: all but those that
  // adaptation copies for its instances. The network must be frozen and in evaluation mode.
  void pack();

  // Saves memory in training: see Vit::recompute_blocks.
  void recompute_blocks(bool recomputes) { backbone_->recompute_blocks(recomputes); }

  const PrimaConfig& config() const { return config_; }
  const Placement& placement() const { return placement_; }
  const Vit& backbone() const { return *backbone_; }
  const BioClip& bioclip() const { return *bioclip_; }
  const Decoder& decoder() const { return *decoder_; }

 private:
  PrimaConfig config_;
  Placement placement_;
  std::shared_ptr<Vit> backbone_;
  std::shared_ptr<Decoder> decoder_;
  std::shared_ptr<BioClip> bioclip_;
};

}  // namespace q3d::model
