// The building blocks that the encoders and the decoder share.
//
// Matrices may be held in bfloat16: activations are cast before a matrix product, the product has the
// matrix's dtype, and adding that to the float32 residual stream gives float32 again. Layer norms, embeddings
// and the regression heads stay float32. With float64 matrices everything is float64, which is too slow for
// use but separates rounding errors from mistakes. Memory is left uninitialised: weights come from a
// checkpoint.
#pragma once

#include <torch/nn/module.h>
#include <torch/types.h>

#include <functional>
#include <string>

#include "model/packed_matrix.h"

namespace q3d::model {

struct Placement {
  torch::Device device = torch::kCPU;
  torch::ScalarType matrix_dtype = torch::kFloat32;

  torch::TensorOptions matrix() const { return torch::TensorOptions(device).dtype(matrix_dtype); }
  torch::ScalarType vector_dtype() const {
    return matrix_dtype == torch::kFloat64 ? torch::kFloat64 : torch::kFloat32;
  }
  torch::TensorOptions vector() const { return torch::TensorOptions(device).dtype(vector_dtype()); }
  Placement unreduced() const { return {device, vector_dtype()}; }  // matrices too as vectors are
};

// Receives named intermediate tensors of a forward pass, for tests and debugging. An empty one costs nothing.
using Observer = std::function<void(const std::string& name, const torch::Tensor& tensor)>;

class Linear : public torch::nn::Module {
 public:
  Linear(std::int64_t in, std::int64_t out, const Placement& placement);
  // (..., in) -> (..., out) in the matrix's dtype.
  torch::Tensor forward(const torch::Tensor& x, Activation activation = Activation::none) const;
  // x W^T alone, without the bias.
  torch::Tensor multiply(const torch::Tensor& x) const;
  // Packs the weight and empties the parameter, so that the numbers are stored once. The layer is frozen
  // afterwards.
  void pack();

  torch::Tensor weight;  // (out, in), or empty once packed
  torch::Tensor bias;    // (out)

 private:
  PackedMatrix packed_;
};

class LayerNorm : public torch::nn::Module {
 public:
  LayerNorm(std::int64_t width, double epsilon, const Placement& placement);
  torch::Tensor forward(const torch::Tensor& x) const;  // (..., width) in the vectors' dtype

 private:
  torch::Tensor weight_;
  torch::Tensor bias_;
  double epsilon_;
};

// Convolution that cuts an image into tokens: (B, 3, H, W) -> (B, rows * columns, width), row-major.
class PatchConv : public torch::nn::Module {
 public:
  PatchConv(std::int64_t width, std::int64_t patch_px, std::int64_t padding_px, bool has_bias,
            const Placement& placement);
  torch::Tensor forward(const torch::Tensor& images) const;

 private:
  torch::Tensor weight_;
  torch::Tensor bias_;
  std::int64_t patch_px_;
  std::int64_t padding_px_;
};

// Scaled dot-product attention over `heads` heads. query (B, N, width), key and value (B, M, width) ->
// (B, N, width).
torch::Tensor attend(const torch::Tensor& query, const torch::Tensor& key, const torch::Tensor& value,
                     std::int64_t heads, double dropout = 0.0);

// Projected keys and values by heads: each (B, heads, M, width / heads).
struct KeysValues {
  torch::Tensor keys, values;
};

// The attention of torch.nn.MultiheadAttention, under its parameter names. Keys and values can be projected
// once and used for many queries.
class MultiheadAttention : public torch::nn::Module {
 public:
  MultiheadAttention(std::int64_t width, std::int64_t heads, double dropout, const Placement& placement);

  // tokens (B, N, width) attend to each other -> (B, queries, width): the first `queries` tokens only, or all
  // when it is 0.
  torch::Tensor self_attention(const torch::Tensor& tokens, std::int64_t queries = 0) const;
  // source (B, M, width) -> keys and values.
  KeysValues project_keys_values(const torch::Tensor& source) const;
  // tokens (B, N, width) attend to projected keys and values -> (B, N, width).
  torch::Tensor cross_attention(const torch::Tensor& tokens, const KeysValues& keys_values) const;

  // Packs the projections of queries, and of keys and values, as Linear::pack does.
  void pack();

 private:
  torch::Tensor project_queries(const torch::Tensor& x) const;  // (B, N, width)
  torch::Tensor project_memory(const torch::Tensor& x) const;   // (B, M, 2 width): keys, then values
  torch::Tensor project(const torch::Tensor& x, std::int64_t first, std::int64_t count) const;
  double dropout() const { return is_training() ? dropout_ : 0.0; }

  torch::Tensor in_proj_weight_;  // (3 width, width): query, key, value rows; empty once packed
  torch::Tensor in_proj_bias_;
  PackedMatrix queries_, memory_;
  std::shared_ptr<Linear> out_proj_;
  std::int64_t width_;
  std::int64_t heads_;
  double dropout_;
};

// The four tensors of a two-layer perceptron: shared, (out, in) and (out), or one set an instance,
// (B, out, in) and (B, out).
struct MlpWeights {
  torch::Tensor hidden_weight, hidden_bias, out_weight, out_bias;
};

// x W^T + b with weight (out, in) and x (..., in), or with weight (B, out, in) and x (B, in).
torch::Tensor affine_each(const torch::Tensor& x, const torch::Tensor& weight, const torch::Tensor& bias);

// x (..., in) for shared weights or (B, in) for one set an instance -> (..., out). ReLU between, leaking
// `negative_slope` of negative values.
torch::Tensor apply_mlp(const MlpWeights& weights, const torch::Tensor& x, double negative_slope = 0.0);

// Linear, (leaky) ReLU, Linear, under the names "0" and "2" of the official torch.nn.Sequential. Its last
// matrix is always float32.
class Mlp : public torch::nn::Module {
 public:
  Mlp(std::int64_t in, std::int64_t hidden, std::int64_t out, const Placement& placement,
      double negative_slope = 0.0);
  torch::Tensor forward(const torch::Tensor& x) const;  // (..., in) -> (..., out) float32
  MlpWeights weights() const;

 private:
  std::shared_ptr<Linear> hidden_;
  std::shared_ptr<Linear> out_;
  double negative_slope_;
};

}  // namespace q3d::model
