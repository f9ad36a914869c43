#include "model/prima.h"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

#include "model/assemble.h"
#include "model/checkpoint.h"
#include "model/net.h"
#include "smal/tensors/asset.h"
#include "smal/tensors/safetensors.h"

namespace q3d::model {
namespace {

constexpr std::int64_t kCropSidePx = 256;

// Of ImageNet, on the scale 0..255.
torch::Tensor per_channel(double red, double green, double blue, torch::Device device) {
  return torch::tensor({static_cast<float>(255.0 * red), static_cast<float>(255.0 * green),
                        static_cast<float>(255.0 * blue)})
      .view({1, 3, 1, 1})
      .to(device);
}

void require_crops(const char* name, const torch::Tensor& crops, torch::ScalarType dtype) {
  if (crops.dim() != 4 || crops.size(1) != 3 || crops.size(2) != kCropSidePx ||
      crops.size(3) != kCropSidePx || crops.scalar_type() != dtype) {
    throw std::invalid_argument(fmt::format(
        "{}: expected (B, 3, 256, 256) {}, got {} dimensions, {} numbers, {}", name, torch::toString(dtype),
        crops.dim(), crops.numel(), torch::toString(crops.scalar_type())));
  }
}

}  // namespace

Prima::Prima(std::shared_ptr<PrimaNet> net, smal::tensors::SmalBody body)
    : net_(std::move(net)), body_(std::move(body)) {
  const torch::Device net_device = net_->parameters().front().device();
  if (net_device != body_.device()) {
    throw std::invalid_argument(
        fmt::format("the network is on {}, the body on {}", net_device.str(), body_.device().str()));
  }
}

Prima Prima::load(const std::filesystem::path& checkpoint, const std::filesystem::path& smal_asset,
                  torch::Device device, torch::ScalarType dtype) {
  if (dtype != torch::kFloat32 && dtype != torch::kBFloat16) {
    throw std::invalid_argument(
        fmt::format("network dtype {} is not float32 or bfloat16", torch::toString(dtype)));
  }
  const smal::tensors::SmalAsset asset = smal::tensors::load_asset(smal_asset);
  const smal::tensors::SafeTensors file = smal::tensors::SafeTensors::open(checkpoint);
  auto net = load_net(file, checkpoint_config(file), asset, {device, dtype});
  net->eval();
  for (auto& parameter : net->parameters()) parameter.set_requires_grad(false);
  return {std::move(net), smal::tensors::SmalBody(asset, device)};
}

torch::Tensor Prima::normalise(const torch::Tensor& crops_u8) const {
  require_crops("crops_u8", crops_u8, torch::kUInt8);
  const torch::Tensor mean = per_channel(0.485, 0.456, 0.406, device());
  const torch::Tensor deviation = per_channel(0.229, 0.224, 0.225, device());
  return (crops_u8.to(device()).to(torch::kFloat32) - mean) / deviation;
}

ImageFeatures Prima::encode(const torch::Tensor& images) const {
  require_crops("images", images, torch::kFloat32);
  const torch::NoGradGuard no_grad;
  return net_->encode(images);
}

Prediction Prima::predict(const ImageFeatures& features, bool with_vertices) const {
  require_features(*net_, features);
  const torch::NoGradGuard no_grad;
  const Decoder& decoder = net_->decoder();
  const torch::Tensor initial_betas = decoder.initial_betas(features.bio_token);
  const DecoderOutput output =
      decoder.refine(decoder.remember(features.image_tokens), initial_betas, decoder.own_parameters());
  return assemble(*net_, body_, output, initial_betas, with_vertices);
}

const PrimaConfig& Prima::config() const {
  return net_->config();
}

}  // namespace q3d::model
