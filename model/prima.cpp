#include "model/prima.h"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

#include "model/assemble.h"
#include "model/checkpoint.h"
#include "model/device.h"
#include "model/net.h"
#include "smal/camera.h"
#include "smal/tensors/asset.h"
#include "smal/tensors/safetensors.h"

namespace q3d::model {
namespace {

// Mean and deviation are ImageNet's, on the scale 0..255. The official code has them as float32 constants,
// whatever the network's dtype.
torch::Tensor per_channel(double red, double green, double blue, torch::TensorOptions options) {
  return torch::tensor({static_cast<float>(255.0 * red), static_cast<float>(255.0 * green),
                        static_cast<float>(255.0 * blue)})
      .view({1, 3, 1, 1})
      .to(options);
}

void require_crops(const char* name, const torch::Tensor& crops, torch::ScalarType dtype) {
  if (crops.dim() != 4 || crops.size(1) != 3 || crops.size(2) != smal::kCropSidePx ||
      crops.size(3) != smal::kCropSidePx || crops.scalar_type() != dtype) {
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
  const torch::ScalarType net_dtype = net_->placement().vector_dtype();
  const torch::ScalarType body_dtype = body_.asset().v_template.scalar_type();
  if (net_dtype != body_dtype) {
    throw std::invalid_argument(fmt::format("the network computes in {}, the body in {}; expected the same",
                                            torch::toString(net_dtype), torch::toString(body_dtype)));
  }
}

Prima Prima::load(const std::filesystem::path& checkpoint, const std::filesystem::path& smal_asset,
                  torch::Device device, torch::ScalarType dtype) {
  if (dtype != torch::kFloat32 && dtype != torch::kBFloat16 && dtype != torch::kFloat64) {
    throw std::invalid_argument(
        fmt::format("network dtype {} is not float32, bfloat16 or float64", torch::toString(dtype)));
  }
  const ReturnFreedMemory while_loading;
  const smal::tensors::SmalAsset asset = smal::tensors::load_asset(smal_asset);
  const smal::tensors::SafeTensors file = smal::tensors::SafeTensors::open(checkpoint);
  auto net = load_net(file, checkpoint_config(file), asset, {device, dtype});
  net->eval();
  for (auto& parameter : net->parameters()) parameter.set_requires_grad(false);
  net->pack();
  const torch::ScalarType body_dtype = net->placement().vector_dtype();
  return {std::move(net), smal::tensors::SmalBody(asset, device).to_dtype(body_dtype)};
}

torch::Tensor Prima::normalise(const torch::Tensor& crops_u8) const {
  require_crops("crops_u8", crops_u8, torch::kUInt8);
  const torch::TensorOptions options = net_->placement().vector();
  const torch::Tensor mean = per_channel(0.485, 0.456, 0.406, options);
  const torch::Tensor deviation = per_channel(0.229, 0.224, 0.225, options);
  return (crops_u8.to(options) - mean) / deviation;
}

ImageFeatures Prima::encode(const torch::Tensor& images) const {
  require_crops("images", images, net_->placement().vector_dtype());
  const at::NoGradGuard no_grad;
  return net_->encode(images);
}

Prediction Prima::predict(const ImageFeatures& features, bool with_vertices) const {
  require_features(*net_, features);
  const at::NoGradGuard no_grad;
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
