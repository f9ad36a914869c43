// PRIMA: image crop -> SMAL pose, betas and camera. Paper sections "Image Encoders" and "Keypoint-aware
// Decoder".
#pragma once

#include <torch/torch.h>

#include <filesystem>
#include <memory>
#include <string>

#include "model/config.h"
#include "smal/body.h"

namespace q3d::model {

// What the frozen encoders make of a batch of crops; test-time adaptation works from these.
struct ImageFeatures {
  torch::Tensor image_tokens;  // (B, 192, D) ViT tokens after the last norm, row-major over 16 x 12
  torch::Tensor bio_token;     // (B, dec_dim)
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
class Prima {
 public:
  // Strict: throws std::runtime_error naming every missing, extra or wrong-shaped tensor. The text tower, the
  // discriminator, the priors and smal.* buffers are the allowed extras (smal.* must agree with the asset's
  // shapes).
  static Prima load(const std::filesystem::path& checkpoint, const std::filesystem::path& smal_asset,
                    torch::Device device, torch::ScalarType dtype = torch::kFloat32);
  Prima(std::shared_ptr<PrimaNet> net, smal::SmalBody body);

  // crops (B, 3, 256, 256) uint8 RGB (any device) -> normalised float input on the network's device.
  torch::Tensor normalise(const torch::Tensor& crops_u8) const;
  // images (B, 3, 256, 256) float32, normalised.
  ImageFeatures encode(const torch::Tensor& images) const;
  Prediction predict(const ImageFeatures& features, bool with_vertices = false) const;

  const PrimaConfig& config() const;
  const smal::SmalBody& body() const { return body_; }
  PrimaNet& net() const { return *net_; }
  torch::Device device() const { return body_.device(); }

 private:
  std::shared_ptr<PrimaNet> net_;
  smal::SmalBody body_;
};

// A seeded checkpoint of the given sizes: every tensor of the official name list except the text tower. The
// same seed gives the same bytes. Sets the identity 6D pose (all-zero would give NaN) and the official
// initial camera.
void write_initial_checkpoint(const std::filesystem::path& path, const PrimaConfig& config,
                              std::uint64_t seed);

}  // namespace q3d::model
