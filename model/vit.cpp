#include "model/vit.h"

#include <string>

#include "model/recomputed.h"

namespace q3d::model {
namespace {

constexpr double kNormEpsilon = 1e-6;
constexpr std::int64_t kPatchPx = 16;
constexpr std::int64_t kPatchPaddingPx = 2;  // shifts the grid by two pixels; still 16 x 12 patches

class VitAttention : public torch::nn::Module {
 public:
  VitAttention(std::int64_t width, std::int64_t heads, const Placement& placement) : heads_(heads) {
    qkv_ = register_module("qkv", std::make_shared<Linear>(width, 3 * width, placement));
    proj_ = register_module("proj", std::make_shared<Linear>(width, width, placement));
  }

  torch::Tensor forward(const torch::Tensor& x) const {
    const auto parts = qkv_->forward(x).chunk(3, 2);
    return proj_->forward(attend(parts[0], parts[1], parts[2], heads_));
  }

 private:
  std::shared_ptr<Linear> qkv_;
  std::shared_ptr<Linear> proj_;
  std::int64_t heads_;
};

class VitMlp : public torch::nn::Module {
 public:
  VitMlp(std::int64_t width, std::int64_t hidden, const Placement& placement) {
    fc1_ = register_module("fc1", std::make_shared<Linear>(width, hidden, placement));
    fc2_ = register_module("fc2", std::make_shared<Linear>(hidden, width, placement));
  }

  torch::Tensor forward(const torch::Tensor& x) const {
    return fc2_->forward(fc1_->forward(x, Activation::gelu));
  }

 private:
  std::shared_ptr<Linear> fc1_;
  std::shared_ptr<Linear> fc2_;
};

}  // namespace

class VitBlock : public torch::nn::Module {
 public:
  VitBlock(const PrimaConfig& config, double drop_path, const Placement& placement) : drop_path_(drop_path) {
    const std::int64_t width = config.embed_dim;
    norm1_ = register_module("norm1", std::make_shared<LayerNorm>(width, kNormEpsilon, placement));
    attn_ = register_module("attn", std::make_shared<VitAttention>(width, config.heads, placement));
    norm2_ = register_module("norm2", std::make_shared<LayerNorm>(width, kNormEpsilon, placement));
    mlp_ = register_module("mlp", std::make_shared<VitMlp>(width, width * config.mlp_ratio, placement));
  }

  torch::Tensor forward(const torch::Tensor& x) const {
    const torch::Tensor attended = x + drop_branch(attn_->forward(norm1_->forward(x)));
    return attended + drop_branch(mlp_->forward(norm2_->forward(attended)));
  }

 private:
  // Applies stochastic depth: in training, whole branches of some samples are left out and the others scaled
  // up.
  torch::Tensor drop_branch(const torch::Tensor& branch) const {
    if (!is_training() || drop_path_ == 0.0) return branch;
    const double keep = 1.0 - drop_path_;
    return branch * torch::empty({branch.size(0), 1, 1}, branch.options()).bernoulli_(keep).div_(keep);
  }

  std::shared_ptr<LayerNorm> norm1_;
  std::shared_ptr<VitAttention> attn_;
  std::shared_ptr<LayerNorm> norm2_;
  std::shared_ptr<VitMlp> mlp_;
  double drop_path_;
};

Vit::Vit(const PrimaConfig& config, const Placement& placement) {
  const std::int64_t width = config.embed_dim;
  pos_embed_ =
      register_parameter("pos_embed", torch::empty({1, kImageTokens + 1, width}, placement.vector()));
  cls_token_ = register_parameter("cls_token", torch::empty({1, 1, width}, placement.vector()));
  const auto patch_embed = register_module("patch_embed", std::make_shared<torch::nn::Module>());
  const Tokeniser::Patches patches{"proj", kPatchPx, kPatchPaddingPx, /*has_bias=*/true};
  const Tokeniser::Stem stem{config.stem_depth, config.efficientnet_stem};
  tokeniser_ = std::make_unique<Tokeniser>(*patch_embed, patches, width, stem, placement);
  const auto blocks = register_module("blocks", std::make_shared<torch::nn::Module>());
  for (std::int64_t i = 0; i < config.depth; ++i) {
    const double rate =
        config.depth == 1 ? 0.0 : config.drop_path * static_cast<double>(i) / (config.depth - 1);
    blocks_.push_back(
        blocks->register_module(std::to_string(i), std::make_shared<VitBlock>(config, rate, placement)));
  }
  last_norm_ = register_module("last_norm", std::make_shared<LayerNorm>(width, kNormEpsilon, placement));
}

torch::Tensor Vit::forward(const torch::Tensor& images, const Observer& observe) const {
  const torch::Tensor patches = tokeniser_->forward(images);
  if (observe) observe("vit_patch_tokens", patches);
  // As in the official code, the class token's position is added to every patch and not to the class token.
  const torch::Tensor placed = patches + pos_embed_.narrow(1, 1, kImageTokens) + pos_embed_.narrow(1, 0, 1);
  torch::Tensor x = torch::cat({cls_token_.expand({images.size(0), -1, -1}), placed}, 1);
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const auto block = [part = blocks_[i]](const torch::Tensor& tokens) { return part->forward(tokens); };
    x = recomputes_ ? recomputed(block, x, blocks_[i]->parameters()) : block(x);
    if (observe) observe("vit_block" + std::to_string(i), x);
  }
  x = last_norm_->forward(x);
  if (observe) observe("backbone_cls", x.select(1, 0));
  return x.narrow(1, 1, kImageTokens);
}

}  // namespace q3d::model
