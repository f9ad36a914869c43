// The BioCLIP image encoder and its projection to the bio token. Paper section "Image Encoders"; official
// code: bioclip_embedding.py and open_clip's VisionTransformer.
#pragma once

#include <torch/nn/module.h>
#include <torch/types.h>

#include <memory>
#include <vector>

#include "model/config.h"
#include "model/conv_stem.h"
#include "model/layers.h"

namespace q3d::model {

class ClipBlock;

// The visual tower of CLIP: ViT with patches of 16 px on 224 x 224 px.
class ClipVisual : public torch::nn::Module {
 public:
  ClipVisual(const PrimaConfig& config, const Placement& placement);

  // images (B, 3, 224, 224) float32 -> (B, clip_out) float32, not normalised to unit length.
  torch::Tensor forward(const torch::Tensor& images) const;

 private:
  torch::Tensor class_embedding_;       // (clip_width)
  torch::Tensor positional_embedding_;  // (197, clip_width)
  torch::Tensor proj_;                  // (clip_width, clip_out)
  std::unique_ptr<Tokeniser> tokeniser_;
  std::shared_ptr<LayerNorm> ln_pre_;
  std::vector<std::shared_ptr<ClipBlock>> blocks_;
  std::shared_ptr<LayerNorm> ln_post_;
};

class BioClip : public torch::nn::Module {
 public:
  BioClip(const PrimaConfig& config, const Placement& placement);

  // images (B, 3, 256, 256) float32, normalised as for the ViT -> bio token (B, embed_dim) float32. The
  // encoder is frozen, so that gradients reach the projection alone, unless the config lets it learn.
  torch::Tensor forward(const torch::Tensor& images, const Observer& observe = {}) const;

  // images as above -> the encoder's own feature (B, clip_out), with its gradients if they are enabled.
  torch::Tensor features(const torch::Tensor& images, const Observer& observe = {}) const;

 private:
  std::shared_ptr<ClipVisual> visual_;
  std::shared_ptr<Linear> projection_;
  std::shared_ptr<LayerNorm> projection_norm_;
  bool learns_;
};

}  // namespace q3d::model
