// PRIMA: image crop -> SMAL pose, betas and camera. Paper sections "Image Encoders" and "Keypoint-aware
// Decoder".
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <filesystem>
#include <memory>

#include "model/config.h"
#include "smal/tensors/body.h"

namespace q3d::model {

// The output of the frozen encoders for a batch of crops. Test-time adaptation works from it.
struct ImageFeatures {
  torch::Tensor image_tokens;  // (B, 192, embed_dim) after the last norm, row-major over 16 x 12 tokens
  torch::Tensor bio_token;     // (B, embed_dim)
};

struct Prediction {
  torch::Tensor rotations;         // (B, 35, 3, 3), joint 0 = global orientation
  torch::Tensor betas;             // (B, 41)
  torch::Tensor camera;            // (B, 3) = (s, tx, ty)
  torch::Tensor translation;       // (B, 3)
  torch::Tensor keypoints_3d;      // (B, 26, 3) SMAL units, camera frame without translation
  torch::Tensor keypoints_2d;      // (B, 26, 2) crop units
  torch::Tensor aux_keypoints_2d;  // (B, 26, 2) crop units: the decoder's last 2D keypoints
  torch::Tensor aux_keypoints_3d;  // (B, 26, 3)
  torch::Tensor init_betas;        // (B, 41)
  torch::Tensor shape_feature;     // (B, 128), unit length
  torch::Tensor vertices;          // (B, V, 3); only when asked for
};

class PrimaNet;  // the torch module, with the official checkpoint's parameter names (model/net.h)

// A loaded network on its device. Copies share the weights. Not thread-safe: one caller at a time.
//
// dtype float32, float64 (all of it, for comparisons with the official code), or bfloat16: then the matrices
// of both encoders, of the decoder layers and of the keypoint readouts are held and multiplied in bfloat16,
// while the residual streams, layer norms, embeddings, regression heads, the body, the losses and all of
// test-time adaptation's parameters stay float32.
class Prima {
 public:
  // Strict: throws std::runtime_error naming every missing, extra, wrong-shaped or wrongly typed tensor. The
  // text tower, the discriminator, the priors and smal.* buffers are the allowed extras (smal.* must agree
  // with the asset's shapes). The network comes frozen and in evaluation mode. Throws std::invalid_argument
  // on another dtype.
  static Prima load(const std::filesystem::path& checkpoint, const std::filesystem::path& smal_asset,
                    torch::Device device, torch::ScalarType dtype = torch::kFloat32);
  // Uses the given network unchanged. Throws std::invalid_argument if the network and the body are on
  // different devices.
  Prima(std::shared_ptr<PrimaNet> net, smal::tensors::SmalBody body);

  // crops (B, 3, 256, 256) uint8 RGB (any device) -> normalised float input on the network's device.
  torch::Tensor normalise(const torch::Tensor& crops_u8) const;
  // images (B, 3, 256, 256), normalised; float32, or float64 for a float64 network.
  ImageFeatures encode(const torch::Tensor& images) const;
  Prediction predict(const ImageFeatures& features, bool with_vertices = false) const;
  // All three throw std::invalid_argument naming the tensor, got and expected, and record no gradients.

  const PrimaConfig& config() const;
  const smal::tensors::SmalBody& body() const { return body_; }
  PrimaNet& net() const { return *net_; }
  torch::Device device() const { return body_.device(); }

 private:
  std::shared_ptr<PrimaNet> net_;
  smal::tensors::SmalBody body_;
};

// A seeded checkpoint of the given sizes: every tensor of the network under its official name (CLIP's text
// tower, the discriminator, the priors and the body are not part of it). The same seed gives the same bytes
// on every machine. Sets the identity 6D pose (all-zero would give NaN) and the official initial camera.
// dtype: float32, float16 or bfloat16. stem: the file of a pre-trained stem (model/pretrained_stem.h), whose
// values every EfficientNet of the network then has and whose origin the metadata tells; or empty. Throws
// std::runtime_error when a file cannot be read or written, std::invalid_argument when there is a stem's file
// but no EfficientNet in the network.
void write_initial_checkpoint(const std::filesystem::path& path, const PrimaConfig& config,
                              std::uint64_t seed, torch::ScalarType dtype = torch::kFloat32,
                              const std::filesystem::path& stem = {});

}  // namespace q3d::model
