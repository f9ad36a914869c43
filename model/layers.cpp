#include "model/layers.h"

#include <cmath>
#include <vector>

namespace q3d::model {
namespace {

// Applies an affine map, with x cast to the matrix's dtype.
torch::Tensor affine(const torch::Tensor& x, const torch::Tensor& weight, const torch::Tensor& bias) {
  return torch::linear(x.to(weight.scalar_type()), weight, bias);
}

// Frees a parameter's numbers. The parameter stays in the module under its name.
void release(torch::Tensor& parameter) {
  parameter.set_data(torch::empty({0}, parameter.options()));
}

// (B, N, width) -> (B, heads, N, width / heads).
torch::Tensor split_heads(const torch::Tensor& x, std::int64_t heads) {
  return x.unflatten(2, {heads, -1}).transpose(1, 2);
}

torch::Tensor join_heads(const torch::Tensor& x) {
  return x.transpose(1, 2).flatten(2);
}

// Attention as two products and a softmax. On a CPU it is faster than LibTorch's fused kernel for bfloat16,
// which oneDNN multiplies, and for gradients, which the fused kernel computes for keys and values too where
// nobody needs them.
torch::Tensor attend_by_products(const torch::Tensor& query, const torch::Tensor& key,
                                 const torch::Tensor& value) {
  const double scale = 1.0 / std::sqrt(static_cast<double>(query.size(-1)));
  const auto stacked = [](const torch::Tensor& x) { return x.flatten(0, 1); };  // (B heads, N, width / heads)
  const torch::Tensor scores = torch::bmm(stacked(query * scale), stacked(key).transpose(1, 2));
  return torch::bmm(scores.softmax(-1), stacked(value)).unflatten(0, {query.size(0), query.size(1)});
}

// query (B, heads, N, d), key and value (B, heads, M, d) -> (B, heads, N, d).
torch::Tensor attend_by_heads(const torch::Tensor& query, const torch::Tensor& key,
                              const torch::Tensor& value, double dropout) {
  const bool has_constant_keys = at::GradMode::is_enabled() && query.requires_grad() && !key.requires_grad();
  const bool is_bfloat16 = query.scalar_type() == torch::kBFloat16;
  if (query.is_cpu() && dropout == 0.0 && (has_constant_keys || is_bfloat16)) {
    return attend_by_products(query, key, value);
  }
  return at::scaled_dot_product_attention(query, key, value, std::nullopt, dropout);
}

}  // namespace

torch::Tensor affine_each(const torch::Tensor& x, const torch::Tensor& weight, const torch::Tensor& bias) {
  if (weight.dim() == 2) return affine(x, weight, bias);
  return torch::baddbmm(bias.unsqueeze(2), weight, x.unsqueeze(2)).squeeze(2);
}

Linear::Linear(std::int64_t in, std::int64_t out, const Placement& placement) {
  weight = register_parameter("weight", torch::empty({out, in}, placement.matrix()));
  bias = register_parameter("bias", torch::empty({out}, placement.matrix()));
}

torch::Tensor Linear::forward(const torch::Tensor& x, Activation activation) const {
  if (packed_.defined()) {
    TORCH_CHECK(!is_training(), "a packed matrix cannot learn: load_net gives a network that can");
    return packed_.multiply(x.to(packed_.dtype()), activation);
  }
  return activate(affine(x, weight, bias), activation);
}

torch::Tensor Linear::multiply(const torch::Tensor& x) const {
  if (packed_.defined()) return packed_.multiply_without_bias(x.to(packed_.dtype()));
  return torch::linear(x.to(weight.scalar_type()), weight);
}

void Linear::pack() {
  packed_ = PackedMatrix(weight, bias);
  release(weight);
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
  return join_heads(attend_by_heads(split_heads(query, heads), split_heads(key, heads),
                                    split_heads(value, heads), dropout));
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

torch::Tensor MultiheadAttention::project_queries(const torch::Tensor& x) const {
  return queries_.defined() ? queries_.multiply(x.to(queries_.dtype())) : project(x, 0, 1);
}

torch::Tensor MultiheadAttention::project_memory(const torch::Tensor& x) const {
  return memory_.defined() ? memory_.multiply(x.to(memory_.dtype())) : project(x, 1, 2);
}

torch::Tensor MultiheadAttention::self_attention(const torch::Tensor& tokens, std::int64_t queries) const {
  std::vector<torch::Tensor> parts;
  if (queries == 0 && !queries_.defined()) {
    parts = project(tokens, 0, 3).chunk(3, 2);
  } else {
    parts = project_memory(tokens).chunk(2, 2);
    parts.insert(parts.begin(), project_queries(queries == 0 ? tokens : tokens.narrow(1, 0, queries)));
  }
  return out_proj_->forward(attend(parts[0], parts[1], parts[2], heads_, dropout()));
}

KeysValues MultiheadAttention::project_keys_values(const torch::Tensor& source) const {
  const auto parts = project_memory(source).chunk(2, 2);
  return {split_heads(parts[0], heads_).contiguous(), split_heads(parts[1], heads_).contiguous()};
}

torch::Tensor MultiheadAttention::cross_attention(const torch::Tensor& tokens,
                                                  const KeysValues& keys_values) const {
  const torch::Tensor query = split_heads(project_queries(tokens), heads_);
  return out_proj_->forward(
      join_heads(attend_by_heads(query, keys_values.keys, keys_values.values, dropout())));
}

void MultiheadAttention::pack() {
  const auto part = [&](const torch::Tensor& rows, std::int64_t first, std::int64_t count) {
    return rows.narrow(0, first * width_, count * width_);
  };
  queries_ = PackedMatrix(part(in_proj_weight_, 0, 1), part(in_proj_bias_, 0, 1));
  memory_ = PackedMatrix(part(in_proj_weight_, 1, 2), part(in_proj_bias_, 1, 2));
  release(in_proj_weight_);
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
  if (negative_slope_ == 0.0) return out_->forward(hidden_->forward(x, Activation::relu));
  return out_->forward(torch::leaky_relu(hidden_->forward(x), negative_slope_));
}

MlpWeights Mlp::weights() const {
  return {hidden_->weight, hidden_->bias, out_->weight, out_->bias};
}

}  // namespace q3d::model
