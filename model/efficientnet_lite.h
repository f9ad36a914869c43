// The first part of EfficientNet-Lite0 (Tan and Le 2019; github.com/tensorflow/tpu, efficientnet/lite), down
// to a sixteenth of the picture's sides, for a network that starts from ImageNet weights. Names and sizes of
// the parameters are those of the PyPI package efficientnet-lite-pytorch 0.1.0, but for batch norm:
//
// Batch norm always uses the statistics of ImageNet. They enter each norm's `weight` and `bias` when the
// weights are imported (tools/import_stem.py), so that a norm is a factor and a summand for each channel,
// which learn. Statistics of a batch would tie a sample's result to its neighbours: the parts of a batch on
// two ranks would not add up to the whole, and batches of 16 are too small to estimate them.
#pragma once

#include <torch/nn/module.h>
#include <torch/types.h>

#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "model/layers.h"

namespace q3d::model {

class InvertedResidual;
class NormedConvolution;

class EfficientNetLite : public torch::nn::Module {
 public:
  static constexpr std::int64_t kBlocks = 11;     // of the network's 16
  static constexpr std::int64_t kChannels = 112;  // of the last of them

  explicit EfficientNetLite(const Placement& placement);

  // images (B, 3, H, W) as PrimaNet takes them, H and W multiples of 16 -> (B, 112, H / 16, W / 16) in the
  // matrices' dtype, in channels-last order.
  torch::Tensor forward(const torch::Tensor& images) const;

 private:
  torch::Tensor input_scale_;  // from PRIMA's normalisation of pictures to this network's
  torch::Tensor input_shift_;
  std::shared_ptr<NormedConvolution> stem_;
  std::vector<std::shared_ptr<InvertedResidual>> blocks_;
};

// The name under which an encoder holds its EfficientNet.
inline constexpr const char* kEfficientNetName = "efficientnet";

// The parameter's name inside the EfficientNet (`_blocks.3._bn1.bias`), or nothing when `parameter`, a name
// in the whole network, belongs to no EfficientNet.
std::string_view name_in_efficientnet(std::string_view parameter);

// Returns whether `parameter`, a name in the whole network, belongs to the first convolution or to the first
// `blocks` blocks of an EfficientNet. With blocks = 0 no parameter does.
bool is_in_first_blocks(std::string_view parameter, std::int64_t blocks);

}  // namespace q3d::model
