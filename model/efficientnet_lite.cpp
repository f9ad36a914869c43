#include "model/efficientnet_lite.h"

#include <array>
#include <charconv>
#include <string>
#include <utility>

#include "model/relu6_convolution.h"

namespace q3d::model {
namespace {

constexpr std::int64_t kStemChannels = 32;

struct BlockSizes {
  std::int64_t side, stride, expansion, channels;
};

// r1_k3_s11_e1_i32_o16, r2_k3_s22_e6_i16_o24, r2_k5_s22_e6_i24_o40, r3_k3_s22_e6_i40_o80,
// r3_k5_s11_e6_i80_o112
constexpr std::array<BlockSizes, EfficientNetLite::kBlocks> kSizes{{{3, 1, 1, 16},
                                                                    {3, 2, 6, 24},
                                                                    {3, 1, 6, 24},
                                                                    {5, 2, 6, 40},
                                                                    {5, 1, 6, 40},
                                                                    {3, 2, 6, 80},
                                                                    {3, 1, 6, 80},
                                                                    {3, 1, 6, 80},
                                                                    {5, 1, 6, 112},
                                                                    {5, 1, 6, 112},
                                                                    {5, 1, 6, 112}}};
static_assert(kSizes.back().channels == EfficientNetLite::kChannels);

// PRIMA normalises with the mean and deviation of ImageNet, EfficientNet-Lite with 127 and 128 (on the scale
// 0..255).
constexpr std::array<double, 3> kMean{0.485, 0.456, 0.406};
constexpr std::array<double, 3> kDeviation{0.229, 0.224, 0.225};
constexpr double kLiteMean = 127.0;
constexpr double kLiteDeviation = 128.0;

// TensorFlow's SAME padding of maps with an even side: at stride 2, the odd pixel comes after the last one.
ConvolutionShape same_padding(std::int64_t side, std::int64_t stride) {
  const std::int64_t padding = side - stride;
  return {side, stride, padding / 2, padding - padding / 2};
}

}  // namespace

// A convolution with SAME padding and its batch norm: y = scale (conv(x)) + shift for each channel, computed
// as one convolution by scaled weights. The weights themselves keep the scale that they were trained at, so
// that steps of equal size suit all of them.
class NormedConvolution {
 public:
  struct Names {
    const char* convolution;
    const char* norm;
  };
  struct Sizes {
    std::int64_t in, out, side, stride, groups;
  };

  NormedConvolution(torch::nn::Module& owner, const Names& names, const Sizes& sizes,
                    const Placement& placement)
      : shape_(same_padding(sizes.side, sizes.stride)) {
    const auto convolution = owner.register_module(names.convolution, std::make_shared<torch::nn::Module>());
    const auto norm = owner.register_module(names.norm, std::make_shared<torch::nn::Module>());
    weight_ = convolution->register_parameter(
        "weight",
        torch::empty({sizes.out, sizes.in / sizes.groups, sizes.side, sizes.side}, placement.matrix()));
    scale_ = norm->register_parameter("weight", torch::empty({sizes.out}, placement.vector()));
    shift_ = norm->register_parameter("bias", torch::empty({sizes.out}, placement.vector()));
  }

  // Without ReLU6: for convolutions of 1 x 1 pixels, which need no padding.
  torch::Tensor forward(const torch::Tensor& x) const { return torch::conv2d(x, weight(), bias()); }

  // The result gets `frame` round it.
  torch::Tensor forward_relu6(const torch::Tensor& x, const Frame& frame = {}) const {
    return relu6_convolution(x, weight(), bias(), shape_, frame);
  }

  // `x` has the zeros round it that this convolution needs.
  torch::Tensor forward_relu6_of_framed(const torch::Tensor& x) const {
    return relu6_convolution(x, weight(), bias(), {shape_.side, shape_.stride, 0, 0});
  }

  const ConvolutionShape& shape() const { return shape_; }
  torch::ScalarType dtype() const { return weight_.scalar_type(); }

 private:
  torch::Tensor weight() const { return (weight_ * scale_.view({-1, 1, 1, 1})).to(dtype()); }
  torch::Tensor bias() const { return shift_.to(dtype()); }

  torch::Tensor weight_;
  torch::Tensor scale_;
  torch::Tensor shift_;
  ConvolutionShape shape_;
};

// A wide depthwise convolution between two 1 x 1 convolutions, and a shortcut where the sizes allow it
// (Sandler et al. 2018).
class InvertedResidual : public torch::nn::Module {
 public:
  InvertedResidual(std::int64_t in, const BlockSizes& sizes, const Placement& placement)
      : has_shortcut_(sizes.stride == 1 && in == sizes.channels) {
    const std::int64_t wide = in * sizes.expansion;
    const auto add = [&](const NormedConvolution::Names& names, const NormedConvolution::Sizes& shape) {
      return std::make_unique<NormedConvolution>(*this, names, shape, placement);
    };
    if (sizes.expansion > 1) expand_ = add({"_expand_conv", "_bn0"}, {in, wide, 1, 1, 1});
    depthwise_ = add({"_depthwise_conv", "_bn1"}, {wide, wide, sizes.side, sizes.stride, wide});
    project_ = add({"_project_conv", "_bn2"}, {wide, sizes.channels, 1, 1, 1});
  }

  torch::Tensor forward(const torch::Tensor& x) const {
    const torch::Tensor narrow = project_->forward(widen_and_convolve(x));
    return has_shortcut_ ? narrow + x : narrow;
  }

 private:
  torch::Tensor widen_and_convolve(const torch::Tensor& x) const {
    if (!expand_) return depthwise_->forward_relu6(x);
    const ConvolutionShape& shape = depthwise_->shape();
    if (shape.before == shape.after) return depthwise_->forward_relu6(expand_->forward_relu6(x));
    // A convolution cannot add unequal numbers of zeros by itself.
    return depthwise_->forward_relu6_of_framed(expand_->forward_relu6(x, {shape.before, shape.after}));
  }

  std::unique_ptr<NormedConvolution> expand_;  // null where the block does not widen
  std::unique_ptr<NormedConvolution> depthwise_;
  std::unique_ptr<NormedConvolution> project_;
  bool has_shortcut_;
};

EfficientNetLite::EfficientNetLite(const Placement& placement) {
  std::vector<double> scale, shift;
  for (std::size_t i = 0; i < kMean.size(); ++i) {
    scale.push_back(255.0 * kDeviation[i] / kLiteDeviation);
    shift.push_back((255.0 * kMean[i] - kLiteMean) / kLiteDeviation);
  }
  input_scale_ = torch::tensor(scale, torch::kFloat64).view({1, 3, 1, 1}).to(placement.vector());
  input_shift_ = torch::tensor(shift, torch::kFloat64).view({1, 3, 1, 1}).to(placement.vector());
  stem_ = std::make_shared<NormedConvolution>(*this, NormedConvolution::Names{"_conv_stem", "_bn0"},
                                              NormedConvolution::Sizes{3, kStemChannels, 3, 2, 1}, placement);
  const auto blocks = register_module("_blocks", std::make_shared<torch::nn::Module>());
  std::int64_t channels = kStemChannels;
  for (const BlockSizes& sizes : kSizes) {
    blocks_.push_back(blocks->register_module(
        std::to_string(blocks_.size()), std::make_shared<InvertedResidual>(channels, sizes, placement)));
    channels = sizes.channels;
  }
}

torch::Tensor EfficientNetLite::forward(const torch::Tensor& images) const {
  const torch::Tensor input = (images * input_scale_ + input_shift_).to(stem_->dtype());
  // Depthwise convolutions of the CPU are three times faster in this order.
  torch::Tensor maps = stem_->forward_relu6(input.contiguous(at::MemoryFormat::ChannelsLast));
  for (const auto& block : blocks_) maps = block->forward(maps);
  return maps;
}

std::string_view name_in_efficientnet(std::string_view parameter) {
  const std::string part = std::string(".") + kEfficientNetName + ".";
  const std::size_t at = parameter.find(part);
  return at == std::string_view::npos ? std::string_view{} : parameter.substr(at + part.size());
}

bool is_in_first_blocks(std::string_view parameter, std::int64_t blocks) {
  const std::string_view name = name_in_efficientnet(parameter);
  if (name.empty() || blocks == 0) return false;
  constexpr std::string_view kBlocksName = "_blocks.";
  if (!name.starts_with(kBlocksName)) return true;  // the first convolution and its norm
  std::int64_t block = 0;
  std::from_chars(name.data() + kBlocksName.size(), name.data() + name.size(), block);
  return block < blocks;
}

}  // namespace q3d::model
