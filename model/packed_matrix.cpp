#include "model/packed_matrix.h"

#include <torch/csrc/autograd/custom_function.h>

#include <optional>
#include <stdexcept>
#include <string_view>

#include "model/compiler_operators.h"

namespace q3d::model {
namespace {

bool has_avx512() {
#if defined(__x86_64__)
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw");
#else
  return false;
#endif
}

torch::Tensor pack(const torch::Tensor& weight) {
  static const auto reorder = find_operator<torch::Tensor(const torch::Tensor&, std::optional<std::int64_t>)>(
      "mkldnn::_reorder_linear_weight");
  return reorder.call(weight.contiguous(), std::nullopt);
}

torch::Tensor multiply_packed(const torch::Tensor& x, const torch::Tensor& packed, const torch::Tensor& bias,
                              Activation activation) {
  using Scalars = c10::List<std::optional<c10::Scalar>>;
  static const auto linear = find_operator<torch::Tensor(
      const torch::Tensor&, const torch::Tensor&, const std::optional<torch::Tensor>&, std::string_view,
      Scalars, std::optional<std::string_view>)>("mkldnn::_linear_pointwise");
  const std::string_view name = activation == Activation::gelu   ? "gelu"
                                : activation == Activation::relu ? "relu"
                                                                 : "none";
  // gelu takes its exact form under the name "none".
  return linear.call(x, packed, bias.defined() ? std::optional(bias) : std::nullopt, name, Scalars(), "none");
}

// The product with its gradient with respect to x.
struct Differentiable : torch::autograd::Function<Differentiable> {
  static torch::Tensor forward(torch::autograd::AutogradContext* context, const torch::Tensor& x,
                               const PackedMatrix* matrix) {
    context->saved_data["transposed"] = matrix->transposed();
    return matrix->multiply(x);  // gradients are off here
  }
  static torch::autograd::variable_list backward(torch::autograd::AutogradContext* context,
                                                 const torch::autograd::variable_list& gradients) {
    const torch::Tensor transposed = context->saved_data["transposed"].toTensor();
    return {multiply_packed(gradients.at(0), transposed, {}, Activation::none), torch::Tensor()};
  }
};

}  // namespace

torch::Tensor activate(const torch::Tensor& x, Activation activation) {
  switch (activation) {
    case Activation::relu:
      return torch::relu(x);
    case Activation::gelu:
      return torch::gelu(x);
    case Activation::none:
      break;
  }
  return x;
}

bool packs_matrices(torch::Device device, torch::ScalarType dtype) {
  static const bool can = has_avx512() && at::hasMKLDNN();
  return can && device.is_cpu() && (dtype == torch::kFloat32 || dtype == torch::kBFloat16);
}

std::string packing_name() {
  return packs_matrices(torch::kCPU, torch::kFloat32) ? "packed matrices" : "";
}

PackedMatrix::PackedMatrix(const torch::Tensor& weight, const torch::Tensor& bias) {
  if (weight.dim() != 2 || (bias.defined() && bias.sizes() != weight.sizes().slice(0, 1))) {
    throw std::invalid_argument("PackedMatrix: expected a weight (out, in) and a bias (out)");
  }
  const at::NoGradGuard no_grad;
  packed_ = pack(weight.detach());
  if (bias.defined()) bias_ = bias.detach().clone();
}

torch::Tensor PackedMatrix::multiply(const torch::Tensor& x, Activation activation) const {
  if (!at::GradMode::is_enabled() || !x.requires_grad())
    return multiply_packed(x, packed_, bias_, activation);
  return activate(Differentiable::apply(x, this), activation);
}

torch::Tensor PackedMatrix::multiply_without_bias(const torch::Tensor& x) const {
  return multiply_packed(x, packed_, {}, Activation::none);
}

const torch::Tensor& PackedMatrix::transposed() const {
  if (!transposed_.defined()) {
    const at::NoGradGuard no_grad;
    transposed_ = pack(packed_.to_dense().t());
  }
  return transposed_;
}

}  // namespace q3d::model
