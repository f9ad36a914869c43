#include "model/layers.h"

#include <vector>

namespace q3d::model {
namespace {

// An affine map with x cast to the matrix's dtype.
torch::Tensor affine(const torch::Tensor& x, const torch::Tensor& weight, const torch::Tensor& bias) {
  return torch::linear(x.to(weight.scalar_type()), weight, bias);
}

// The same with weight (out, in), or (B, out, in) for x (B, in).
torch::Tensor affine_each(const torch::Tensor& x, const torch::Tensor& weight, const torch::Tensor& bias) {
  if (weight.dim() == 2) return affine(x, weight, bias);
  return torch::baddbmm(bias.unsqueeze(2), weight, x.unsqueeze(2)).squeeze(2);
}

}  // namespace

Linear::Linear(std::int64_t in, std::int64_t out, const Placement& placement) {
  weight = register_parameter("weight", torch::empty({out, in}, placement.matrix()));
  bias = register_parameter("bias", torch::empty({out}, placement.matrix()));
}

torch::Tensor Linear::forward(const torch::Tensor& x) const {
  return affine(x, weight, bias);
}

LayerNorm::LayerNorm(std::int64_t width, double epsilon, const Placement& placement) : epsilon_(epsilon) {
  weight_ = register_parameter("weight", torch::empty({width}, placement.vector()));
  bias_ = register_parameter("bias", torch::empty({width}, placement.vector()));
}

torch::Tensor LayerNorm::forward(const torch::Tensor& x) const {
  return torch::layer_norm(x.to(weight_.scalar_type()), weight_.sizes(), weight_, bias_, epsilon_);
}

PatchConv::PatchConv(std::int64_t width, std::int64_t patch_px, std::int64_t padding_px, bool has_bias,
                     const Placement& placement)
    : patch_px_(patch_px), padding_px_(padding_px) {
  weight_ = register_parameter("weight", torch::empty({width, 3, patch_px, patch_px}, placement.matrix()));
  if (has_bias) bias_ = register_parameter("bias", torch::empty({width}, placement.matrix()));
}

torch::Tensor PatchConv::forward(const torch::Tensor& images) const {
  const torch::Tensor maps =
      torch::conv2d(images.to(weight_.scalar_type()), weight_, bias_, patch_px_, padding_px_);
  return maps.flatten(2).transpose(1, 2);
}

torch::Tensor attend(const torch::Tensor& query, const torch::Tensor& key, const torch::Tensor& value,
                     std::int64_t heads, double dropout) {
  const auto split = [heads](const torch::Tensor& x) {  // (B, N, width) -> (B, heads, N, width / heads)
    return x.unflatten(2, {heads, -1}).transpose(1, 2);
  };
  const torch::Tensor mixed =
      at::scaled_dot_product_attention(split(query), split(key), split(value), std::nullopt, dropout);
  return mixed.transpose(1, 2).flatten(2);
}

MultiheadAttention::MultiheadAttention(std::int64_t width, std::int64_t heads, double dropout,
                                       const Placement& placement)
    : width_(width), heads_(heads), dropout_(dropout) {
  in_proj_weight_ =
      register_parameter("in_proj_weight", torch::empty({3 * width, width}, placement.matrix()));
  in_proj_bias_ = register_parameter("in_proj_bias", torch::empty({3 * width}, placement.matrix()));
  out_proj_ = register_module("out_proj", std::make_shared<Linear>(width, width, placement));
}

torch::Tensor MultiheadAttention::project(const torch::Tensor& x, std::int64_t first,
                                          std::int64_t count) const {
  return affine(x, in_proj_weight_.narrow(0, first * width_, count * width_),
                in_proj_bias_.narrow(0, first * width_, count * width_));
}

torch::Tensor MultiheadAttention::attend_and_mix(const torch::Tensor& query, const torch::Tensor& key,
                                                 const torch::Tensor& value) const {
  return out_proj_->forward(attend(query, key, value, heads_, is_training() ? dropout_ : 0.0));
}

torch::Tensor MultiheadAttention::self_attention(const torch::Tensor& tokens, std::int64_t queries) const {
  if (queries == 0) {
    const auto parts = project(tokens, 0, 3).chunk(3, 2);
    return attend_and_mix(parts[0], parts[1], parts[2]);
  }
  const auto parts = project(tokens, 1, 2).chunk(2, 2);
  return attend_and_mix(project(tokens.narrow(1, 0, queries), 0, 1), parts[0], parts[1]);
}

torch::Tensor MultiheadAttention::project_keys_values(const torch::Tensor& source) const {
  return project(source, 1, 2);
}

torch::Tensor MultiheadAttention::cross_attention(const torch::Tensor& tokens,
                                                  const torch::Tensor& keys_values) const {
  const auto parts = keys_values.chunk(2, 2);
  return attend_and_mix(project(tokens, 0, 1), parts[0], parts[1]);
}

torch::Tensor apply_mlp(const MlpWeights& weights, const torch::Tensor& x, double negative_slope) {
  torch::Tensor hidden = affine_each(x, weights.hidden_weight, weights.hidden_bias);
  hidden = negative_slope == 0.0 ? torch::relu(hidden) : torch::leaky_relu(hidden, negative_slope);
  return affine_each(hidden, weights.out_weight, weights.out_bias);
}

Mlp::Mlp(std::int64_t in, std::int64_t hidden, std::int64_t out, const Placement& placement,
         double negative_slope)
    : negative_slope_(negative_slope) {
  hidden_ = register_module("0", std::make_shared<Linear>(in, hidden, placement));
  out_ = register_module("2", std::make_shared<Linear>(hidden, out, placement.unreduced()));
}

torch::Tensor Mlp::forward(const torch::Tensor& x) const {
  return apply_mlp(weights(), x, negative_slope_);
}

MlpWeights Mlp::weights() const {
  return {hidden_->weight, hidden_->bias, out_->weight, out_->bias};
}

}  // namespace q3d::model
