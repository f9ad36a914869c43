#include "model/conv_stem.h"

#include <algorithm>
#include <string>

namespace q3d::model {
namespace {

constexpr double kNormEpsilon = 1e-5;
constexpr std::int64_t kChannelsPerGroup = 16;

}  // namespace

class ConvUnit : public torch::nn::Module {
 public:
  ConvUnit(std::int64_t in, std::int64_t out, std::int64_t side, std::int64_t stride,
           const Placement& placement)
      : groups_(std::max<std::int64_t>(1, out / kChannelsPerGroup)), side_(side), stride_(stride) {
    weight_ = register_parameter("weight", torch::empty({out, in, side, side}, placement.matrix()));
    const auto norm = register_module("norm", std::make_shared<torch::nn::Module>());
    norm_weight_ = norm->register_parameter("weight", torch::empty({out}, placement.vector()));
    norm_bias_ = norm->register_parameter("bias", torch::empty({out}, placement.vector()));
  }

  torch::Tensor forward(const torch::Tensor& x) const {
    const torch::Tensor maps =
        torch::conv2d(x.to(weight_.scalar_type()), weight_, {}, stride_, /*padding=*/side_ / 2);
    // Only the CPU's group norm takes reduced maps beside float32 weights.
    const torch::Tensor in = maps.is_cpu() ? maps : maps.to(norm_weight_.scalar_type());
    return torch::relu(torch::group_norm(in, groups_, norm_weight_, norm_bias_, kNormEpsilon));
  }

 private:
  torch::Tensor weight_;
  torch::Tensor norm_weight_;
  torch::Tensor norm_bias_;
  std::int64_t groups_;
  std::int64_t side_;
  std::int64_t stride_;
};

ConvStem::ConvStem(std::int64_t width, std::int64_t depth, const Placement& placement) {
  const auto add = [&](std::int64_t in, std::int64_t out, std::int64_t side, std::int64_t stride) {
    units_.push_back(register_module(std::to_string(units_.size()),
                                     std::make_shared<ConvUnit>(in, out, side, stride, placement)));
  };
  const std::int64_t quarter = width / 4;
  const std::int64_t half = width / 2;
  add(3, quarter, 7, 4);
  add(quarter, half, 3, 2);
  add(half, half, 3, 1);
  add(half, width, 3, 2);
  for (std::int64_t i = 0; i < depth; ++i) add(width, width, 3, 1);
  proj_ = register_module("proj", std::make_shared<Linear>(width, width, placement));
}

torch::Tensor ConvStem::forward(const torch::Tensor& images) const {
  torch::Tensor maps = images;
  for (const auto& unit : units_) maps = unit->forward(maps);
  return proj_->forward(maps.flatten(2).transpose(1, 2));
}

Tokeniser::Tokeniser(torch::nn::Module& owner, const Patches& patches, std::int64_t width, const Stem& stem,
                     const Placement& placement) {
  if (stem.depth > 0) {
    stem_ = owner.register_module("stem", std::make_shared<ConvStem>(width, stem.depth, placement));
    return;
  }
  if (stem.efficientnet) {
    efficientnet_ = owner.register_module(kEfficientNetName, std::make_shared<EfficientNetLite>(placement));
    proj_ = owner.register_module(patches.projection,
                                  std::make_shared<Linear>(EfficientNetLite::kChannels, width, placement));
    return;
  }
  patches_ = owner.register_module(
      patches.projection,
      std::make_shared<PatchConv>(width, patches.patch_px, patches.padding_px, patches.has_bias, placement));
}

torch::Tensor Tokeniser::forward(const torch::Tensor& images) const {
  if (stem_) return stem_->forward(images);
  if (patches_) return patches_->forward(images);
  // The maps lie in channels-last order, so that their tokens are a view of them.
  return proj_->forward(efficientnet_->forward(images).permute({0, 2, 3, 1}).flatten(1, 2));
}

}  // namespace q3d::model
