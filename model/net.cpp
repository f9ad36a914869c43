#include "model/net.h"

#include <set>

namespace q3d::model {
namespace {

// The ViT sees the middle 192 columns of the crop, BioCLIP all 256.
constexpr std::int64_t kFirstColumnPx = 32;
constexpr std::int64_t kColumnsPx = 192;

}  // namespace

PrimaNet::PrimaNet(const PrimaConfig& config, const Placement& placement)
    : config_(config), placement_(placement) {
  check_config(config);
  backbone_ = register_module("backbone", std::make_shared<Vit>(config, placement));
  decoder_ = register_module("smal_head", std::make_shared<Decoder>(config, placement));
  bioclip_ = register_module("bioclip_embedding", std::make_shared<BioClip>(config, placement));
}

torch::Tensor PrimaNet::image_tokens(const torch::Tensor& images, const Observer& observe) const {
  return backbone_->forward(images.narrow(3, kFirstColumnPx, kColumnsPx), observe);
}

ImageFeatures PrimaNet::encode(const torch::Tensor& images, const Observer& observe) const {
  ImageFeatures features;
  features.image_tokens = image_tokens(images, observe);
  features.bio_token = bioclip_->forward(images, observe);
  return features;
}

void PrimaNet::pack() {
  if (!packs_matrices(placement_.device, placement_.matrix_dtype)) return;
  const AdaptedParameters adapted = decoder_->own_parameters();
  std::set<const void*> kept;
  for (const MlpWeights* head : {&adapted.pose_head, &adapted.shape_head, &adapted.camera_head}) {
    kept.insert(head->hidden_weight.unsafeGetTensorImpl());
    kept.insert(head->out_weight.unsafeGetTensorImpl());
  }
  const at::NoGradGuard no_grad;
  for (const auto& module : modules(/*include_self=*/false)) {
    if (auto* linear = module->as<Linear>()) {
      if (!kept.contains(linear->weight.unsafeGetTensorImpl())) linear->pack();
    } else if (auto* attention = module->as<MultiheadAttention>()) {
      attention->pack();
    }
  }
}

}  // namespace q3d::model
