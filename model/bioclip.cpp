#include "model/bioclip.h"

#include <string>

namespace q3d::model {
namespace {

constexpr double kNormEpsilon = 1e-5;
constexpr std::int64_t kClipSidePx = 224;
constexpr std::int64_t kPatchPx = 16;
constexpr std::int64_t kClipTokens = (kClipSidePx / kPatchPx) * (kClipSidePx / kPatchPx);
constexpr std::int64_t kMlpRatio = 4;

class ClipMlp : public torch::nn::Module {
 public:
  ClipMlp(std::int64_t width, bool quick_gelu, const Placement& placement) : quick_gelu_(quick_gelu) {
    c_fc_ = register_module("c_fc", std::make_shared<Linear>(width, kMlpRatio * width, placement));
    c_proj_ = register_module("c_proj", std::make_shared<Linear>(kMlpRatio * width, width, placement));
  }

  torch::Tensor forward(const torch::Tensor& x) const {
    if (!quick_gelu_) return c_proj_->forward(c_fc_->forward(x, Activation::gelu));
    const torch::Tensor hidden = c_fc_->forward(x);
    return c_proj_->forward(hidden * torch::sigmoid(1.702 * hidden));
  }

 private:
  std::shared_ptr<Linear> c_fc_;
  std::shared_ptr<Linear> c_proj_;
  bool quick_gelu_;
};

}  // namespace

class ClipBlock : public torch::nn::Module {
 public:
  ClipBlock(const PrimaConfig& config, const Placement& placement) {
    const std::int64_t width = config.clip_width;
    ln_1_ = register_module("ln_1", std::make_shared<LayerNorm>(width, kNormEpsilon, placement));
    attn_ = register_module(
        "attn", std::make_shared<MultiheadAttention>(width, config.clip_heads, /*dropout=*/0.0, placement));
    ln_2_ = register_module("ln_2", std::make_shared<LayerNorm>(width, kNormEpsilon, placement));
    mlp_ = register_module("mlp", std::make_shared<ClipMlp>(width, config.clip_quick_gelu, placement));
  }

  torch::Tensor forward(const torch::Tensor& x) const {
    const torch::Tensor attended = x + attn_->self_attention(ln_1_->forward(x));
    return attended + mlp_->forward(ln_2_->forward(attended));
  }

 private:
  std::shared_ptr<LayerNorm> ln_1_;
  std::shared_ptr<MultiheadAttention> attn_;
  std::shared_ptr<LayerNorm> ln_2_;
  std::shared_ptr<ClipMlp> mlp_;
};

ClipVisual::ClipVisual(const PrimaConfig& config, const Placement& placement) {
  const std::int64_t width = config.clip_width;
  class_embedding_ = register_parameter("class_embedding", torch::empty({width}, placement.vector()));
  positional_embedding_ =
      register_parameter("positional_embedding", torch::empty({kClipTokens + 1, width}, placement.vector()));
  proj_ = register_parameter("proj", torch::empty({width, config.clip_out}, placement.vector()));
  const Tokeniser::Patches patches{"conv1", kPatchPx, /*padding_px=*/0, /*has_bias=*/false};
  const Tokeniser::Stem stem{config.clip_stem_depth, config.clip_efficientnet_stem};
  tokeniser_ = std::make_unique<Tokeniser>(*this, patches, width, stem, placement);
  ln_pre_ = register_module("ln_pre", std::make_shared<LayerNorm>(width, kNormEpsilon, placement));
  const auto transformer = register_module("transformer", std::make_shared<torch::nn::Module>());
  const auto blocks = transformer->register_module("resblocks", std::make_shared<torch::nn::Module>());
  for (std::int64_t i = 0; i < config.clip_layers; ++i) {
    blocks_.push_back(
        blocks->register_module(std::to_string(i), std::make_shared<ClipBlock>(config, placement)));
  }
  ln_post_ = register_module("ln_post", std::make_shared<LayerNorm>(width, kNormEpsilon, placement));
}

torch::Tensor ClipVisual::forward(const torch::Tensor& images) const {
  const torch::Tensor patches = tokeniser_->forward(images);
  const torch::Tensor cls = class_embedding_.expand({images.size(0), 1, -1});
  torch::Tensor x = ln_pre_->forward(torch::cat({cls, patches}, 1) + positional_embedding_);
  for (const auto& block : blocks_) x = block->forward(x);
  return ln_post_->forward(x.select(1, 0)).matmul(proj_);
}

BioClip::BioClip(const PrimaConfig& config, const Placement& placement) : learns_(config.learn_bio_encoder) {
  const auto species_model = register_module("species_model", std::make_shared<torch::nn::Module>());
  visual_ = species_model->register_module("visual", std::make_shared<ClipVisual>(config, placement));
  const auto projection = register_module("projection", std::make_shared<torch::nn::Module>());
  projection_ = projection->register_module(
      "0", std::make_shared<Linear>(config.clip_out, config.embed_dim, placement.unreduced()));
  projection_norm_ = projection->register_module(
      "1", std::make_shared<LayerNorm>(config.embed_dim, kNormEpsilon, placement));
}

torch::Tensor BioClip::features(const torch::Tensor& images, const Observer& observe) const {
  const torch::Tensor resized =
      torch::upsample_bilinear2d(images, {kClipSidePx, kClipSidePx}, /*align_corners=*/false);
  if (observe) observe("bioclip_resized_img", resized);
  return visual_->forward(resized);
}

torch::Tensor BioClip::forward(const torch::Tensor& images, const Observer& observe) const {
  torch::Tensor feature;
  {
    const at::AutoGradMode mode(learns_ && at::GradMode::is_enabled());
    feature = features(images, observe);
  }
  if (observe) observe("bioclip_feature", feature);
  return projection_norm_->forward(projection_->forward(feature));
}

}  // namespace q3d::model
