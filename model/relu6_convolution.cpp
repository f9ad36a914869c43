#include "model/relu6_convolution.h"

#include <torch/csrc/autograd/custom_function.h>

#include <array>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "model/compiler_operators.h"
#include "model/packed_matrix.h"

namespace q3d::model {
namespace {

constexpr double kLargest = 6.0;

std::int64_t groups_of(const torch::Tensor& maps, const torch::Tensor& weight) {
  const bool depthwise = weight.size(1) == 1 && maps.size(1) > 1;
  return depthwise ? maps.size(1) : 1;
}

torch::Tensor pad(const torch::Tensor& maps, std::int64_t before, std::int64_t after) {
  if (before == 0 && after == 0) return maps;
  return torch::constant_pad_nd(maps, {before, after, before, after});
}

torch::Tensor without_border(const torch::Tensor& maps, std::int64_t before, std::int64_t after) {
  const std::int64_t both = before + after;
  return maps.narrow(2, before, maps.size(2) - both).narrow(3, before, maps.size(3) - both);
}

void clear_border(const torch::Tensor& maps, const Frame& frame) {
  if (frame.before == 0 && frame.after == 0) return;
  for (const std::int64_t axis : {2, 3}) {
    maps.narrow(axis, 0, frame.before).zero_();
    maps.narrow(axis, maps.size(axis) - frame.after, frame.after).zero_();
  }
}

// The convolutions of LibTorch and oneDNN add as many zeros before the maps as after them.
struct EvenlyPadded {
  EvenlyPadded(const torch::Tensor& unpadded, const ConvolutionShape& shape)
      : maps(shape.before == shape.after ? unpadded : pad(unpadded, shape.before, shape.after)),
        padding(shape.before == shape.after ? shape.before : 0) {}
  torch::Tensor maps;
  std::int64_t padding;  // zeros that the convolution is still to add on each side
};

torch::Tensor fused_value(const EvenlyPadded& input, const torch::Tensor& weight, const torch::Tensor& bias,
                          std::int64_t stride, std::int64_t groups) {
  using Sides = at::IntArrayRef;
  using Scalars = c10::List<std::optional<c10::Scalar>>;
  static const auto convolve = find_operator<torch::Tensor(
      const torch::Tensor&, const torch::Tensor&, const std::optional<torch::Tensor>&, Sides, Sides, Sides,
      std::int64_t, std::string_view, Scalars, std::optional<std::string_view>)>(
      "mkldnn::_convolution_pointwise");
  const std::array<std::int64_t, 2> paddings{input.padding, input.padding};
  const std::array<std::int64_t, 2> strides{stride, stride};
  const std::array<std::int64_t, 2> dilations{1, 1};
  const Scalars limits({c10::Scalar(0.0), c10::Scalar(kLargest)});
  return convolve.call(input.maps, weight, bias, paddings, strides, dilations, groups, "hardtanh", limits,
                       "");
}

torch::Tensor value_of(const torch::Tensor& maps, const torch::Tensor& weight, const torch::Tensor& bias,
                       const ConvolutionShape& shape) {
  const EvenlyPadded input(maps, shape);
  const std::int64_t groups = groups_of(maps, weight);
  if (packs_matrices(maps.device(), maps.scalar_type())) {
    return fused_value(input, weight, bias, shape.stride, groups);
  }
  torch::Tensor value =
      torch::conv2d(input.maps, weight, bias, shape.stride, input.padding, /*dilation=*/1, groups);
  return torch::hardtanh_(value, 0.0, kLargest);
}

ConvolutionGradients dense_gradients(const torch::Tensor& gradient, const torch::Tensor& maps,
                                     const torch::Tensor& weight, const ConvolutionShape& shape,
                                     const std::array<bool, 3>& needed) {
  const EvenlyPadded input(maps, shape);
  const std::array<std::int64_t, 2> paddings{input.padding, input.padding};
  const std::array<std::int64_t, 2> strides{shape.stride, shape.stride};
  auto [of_maps, of_weight, of_bias] = at::convolution_backward(
      gradient, input.maps, weight, at::IntArrayRef({weight.size(0)}), strides, paddings,
      at::IntArrayRef({1, 1}), /*transposed=*/false, at::IntArrayRef({0, 0}), /*groups=*/1, needed);
  if (needed[0] && shape.before != shape.after) of_maps = without_border(of_maps, shape.before, shape.after);
  return {of_maps, of_weight, of_bias};
}

// relu6(conv(maps)) in a frame of zeros. No gradient passes where the result is 0 or 6, and so none passes
// through the frame.
class Relu6Convolution : public torch::autograd::Function<Relu6Convolution> {
 public:
  static torch::Tensor forward(torch::autograd::AutogradContext* context, const torch::Tensor& maps,
                               const torch::Tensor& weight, const torch::Tensor& bias,
                               const ConvolutionShape& shape, const Frame& frame) {
    const torch::Tensor input = pad(maps, frame.before, frame.after);
    const torch::Tensor value = value_of(input, weight, bias, shape);
    clear_border(value, frame);
    context->save_for_backward({input, weight, value});
    context->saved_data["shape"] =
        std::vector<std::int64_t>{shape.side, shape.stride, shape.before, shape.after};
    context->saved_data["frame"] = std::vector<std::int64_t>{frame.before, frame.after};
    return value;
  }

  static torch::autograd::variable_list backward(torch::autograd::AutogradContext* context,
                                                 const torch::autograd::variable_list& gradients) {
    const auto saved = context->get_saved_variables();
    const torch::Tensor& input = saved[0];
    const torch::Tensor& weight = saved[1];
    const auto numbers = context->saved_data["shape"].toIntVector();
    const auto frame = context->saved_data["frame"].toIntVector();
    const ConvolutionShape shape{numbers[0], numbers[1], numbers[2], numbers[3]};
    const std::array<bool, 3> needed{context->needs_input_grad(0), context->needs_input_grad(1),
                                     context->needs_input_grad(2)};
    const torch::Tensor passed =
        at::hardtanh_backward(gradients[0].to(input.scalar_type()), saved[2], 0.0, kLargest);
    const ConvolutionGradients result = groups_of(input, weight) > 1
                                            ? depthwise_gradients(passed, input, weight, shape, needed)
                                            : dense_gradients(passed, input, weight, shape, needed);
    const torch::Tensor of_maps =
        result.maps.defined() ? without_border(result.maps, frame[0], frame[1]) : torch::Tensor();
    return {of_maps, result.weight, result.bias, torch::Tensor(), torch::Tensor()};
  }
};

// Says whether Relu6Convolution computes the gradients.
bool has_own_gradients(const torch::Tensor& maps) {
  return maps.is_cpu() && (maps.scalar_type() == torch::kFloat32 || maps.scalar_type() == torch::kBFloat16);
}

}  // namespace

torch::Tensor relu6_convolution(const torch::Tensor& maps, const torch::Tensor& weight,
                                const torch::Tensor& bias, const ConvolutionShape& shape,
                                const Frame& frame) {
  if ((frame.before > 0 || frame.after > 0) && (shape.side > 1 || shape.stride > 1)) {
    throw std::invalid_argument("relu6_convolution: only a convolution of 1 x 1 pixels can have a frame");
  }
  if (has_own_gradients(maps)) return Relu6Convolution::apply(maps, weight, bias, shape, frame);
  return pad(value_of(maps, weight, bias, shape), frame.before, frame.after);
}

}  // namespace q3d::model
