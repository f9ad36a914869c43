// Frozen matrices in the order in which oneDNN's kernels read them.
//
// LibTorch multiplies float32 matrices by MKL, which takes its slow path on processors that are not Intel's,
// and packs the weights again at every call. oneDNN takes the fast path on all of them, and packs once.
#pragma once

#include <torch/types.h>

#include <string>

namespace q3d::model {

enum class Activation { none, relu, gelu };

torch::Tensor activate(const torch::Tensor& x, Activation activation);

// Says whether the frozen matrices of a network are packed: on CPUs with AVX-512, in float32 and bfloat16.
// The rule is fixed because the two ways round differently, and a choice by timing could differ between two
// runs.
bool packs_matrices(torch::Device device, torch::ScalarType dtype);

// Returns the text for the rule in the stage keys of a CPU: "packed matrices", or "".
std::string packing_name();

// x -> x W^T + b. It cannot learn: gradients flow to x alone.
class PackedMatrix {
 public:
  PackedMatrix() = default;
  // weight (out, in), and bias (out) or an undefined tensor. Copies the weight; the caller may drop its own.
  PackedMatrix(const torch::Tensor& weight, const torch::Tensor& bias);

  bool defined() const { return packed_.defined(); }
  torch::ScalarType dtype() const { return packed_.scalar_type(); }

  // x (..., in) in the matrix's dtype -> (..., out).
  torch::Tensor multiply(const torch::Tensor& x, Activation activation = Activation::none) const;
  // x W^T, without the bias and without gradients.
  torch::Tensor multiply_without_bias(const torch::Tensor& x) const;

  // The packed W^T, which gradients need. It is made at the first call, because many networks never see one.
  const torch::Tensor& transposed() const;

 private:
  torch::Tensor packed_;
  torch::Tensor bias_;
  mutable torch::Tensor transposed_;
};

}  // namespace q3d::model
