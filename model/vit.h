// The ViT image encoder. Paper section "Image Encoders"; official code: backbones/vit.py.
#pragma once

#include <torch/nn/module.h>
#include <torch/types.h>

#include <memory>
#include <vector>

#include "model/config.h"
#include "model/conv_stem.h"
#include "model/layers.h"

namespace q3d::model {

inline constexpr std::int64_t kTokenRows = 16;
inline constexpr std::int64_t kTokenColumns = 12;
inline constexpr std::int64_t kImageTokens = kTokenRows * kTokenColumns;

class VitBlock;

class Vit : public torch::nn::Module {
 public:
  Vit(const PrimaConfig& config, const Placement& placement);

  // images (B, 3, 256, 192) float32, normalised -> (B, 192, embed_dim) float32, row-major over 16 x 12
  // tokens.
  torch::Tensor forward(const torch::Tensor& images, const Observer& observe = {}) const;

  // From now on, training keeps only the input of each block and computes the block again (recomputed.h).
  void recompute_blocks(bool recomputes) { recomputes_ = recomputes; }

 private:
  std::unique_ptr<Tokeniser> tokeniser_;
  torch::Tensor pos_embed_;  // (1, 193, embed_dim)
  torch::Tensor cls_token_;  // (1, 1, embed_dim)
  std::vector<std::shared_ptr<VitBlock>> blocks_;
  std::shared_ptr<LayerNorm> last_norm_;
  bool recomputes_ = false;
};

}  // namespace q3d::model
