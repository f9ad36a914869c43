// The keypoint-aware decoder. Paper section "Keypoint-aware Decoder"; official code: heads/smal_head.py,
// NewBioGuidedSMALPoseDecoder.
#pragma once

#include <torch/nn/module.h>
#include <torch/types.h>

#include <memory>
#include <string>
#include <vector>

#include "model/config.h"
#include "model/layers.h"
#include "smal/sizes.h"

namespace q3d::model {

inline constexpr std::int64_t kKeypoints = smal::kNumKeypoints;
inline constexpr std::int64_t kPose6d = smal::kNumJoints * 6;
inline constexpr std::int64_t kBetas = smal::kNumBetas;
inline constexpr std::int64_t kCamera = 3;

// Test-time adaptation may change these parameters: the keypoint embeddings and the three regression heads.
// There is one set for the whole batch (the network's own), or one for each instance, with a batch axis.
struct AdaptedParameters {
  torch::Tensor keypoint_2d_embeddings;  // (26, D) or (B, 26, D)
  torch::Tensor keypoint_3d_embeddings;
  MlpWeights pose_head, shape_head, camera_head;
};

// Everything that the decoder layers need from an image. It is computed once, however often they run.
struct DecoderMemory {
  std::vector<KeysValues> keys_values;  // a layer: each (B, heads, 192, D / heads)
  torch::Tensor sampled;                // (B, 192, D): image tokens as they enter the 2D keypoint tokens
};

struct DecoderOutput {
  torch::Tensor pose_6d;           // (B, 210)
  torch::Tensor betas;             // (B, 41)
  torch::Tensor camera;            // (B, 3) = (s, tx, ty)
  torch::Tensor aux_keypoints_2d;  // (B, 26, 2) crop units: the last update's; zeros without keypoint tokens
  torch::Tensor aux_keypoints_3d;  // (B, 26, 3): not centred
};

// Records a perceptron's passes, one for each round: the inputs of its two matrices, and copies of its biases
// that are leaves of the graph. The gradient of a matrix is the sum over the rounds of outer products of a
// bias's gradient and its input, so it need not be stored as a matrix.
struct MlpTape {
  std::vector<torch::Tensor> inputs, hidden_biases;  // (B, in), (B, hidden)
  std::vector<torch::Tensor> hidden, out_biases;     // (B, hidden), (B, out)
};
struct HeadTapes {
  MlpTape pose, shape, camera;
};

class DecoderLayer;

class Decoder : public torch::nn::Module {
 public:
  Decoder(const PrimaConfig& config, const Placement& placement);

  // image_tokens (B, 192, embed_dim), row-major over 16 x 12.
  DecoderMemory remember(const torch::Tensor& image_tokens, const Observer& observe = {}) const;

  // bio_token (B, embed_dim) -> (B, 41); zeros where the config takes no betas from it.
  torch::Tensor initial_betas(const torch::Tensor& bio_token) const;
  // Maps betas (B, 41) to features (B, 128) of unit length, for the contrastive loss.
  torch::Tensor shape_feature(const torch::Tensor& betas) const;

  AdaptedParameters own_parameters() const;

  // Runs all rounds of iterative error feedback. initial_betas: (B, 41). With `tapes`, the passes of the
  // heads are recorded there.
  DecoderOutput refine(const DecoderMemory& memory, const torch::Tensor& initial_betas,
                       const AdaptedParameters& parameters, const Observer& observe = {},
                       HeadTapes* tapes = nullptr) const;

 private:
  struct KeypointUpdate;
  KeypointUpdate update_keypoints(const torch::Tensor& tokens, const torch::Tensor& sampled_source) const;
  torch::Tensor parameter_token(const DecoderOutput& estimate) const;
  torch::Tensor initial_tokens(const DecoderOutput& estimate, const AdaptedParameters& parameters) const;
  torch::Tensor run_layers(torch::Tensor tokens, const DecoderMemory& memory, DecoderOutput& estimate,
                           const std::string& prefix, const Observer& observe) const;

  std::int64_t rounds_;
  bool betas_from_bio_;
  bool has_keypoint_tokens_;
  bool true_token_grid_;
  torch::Tensor init_pose_;  // (1, 210)
  torch::Tensor init_cam_;   // (1, 3)
  torch::Tensor position_;   // (192, D), not a parameter
  std::shared_ptr<Mlp> bio_to_betas_init_;
  std::shared_ptr<Mlp> shape_projector_;
  std::shared_ptr<Linear> param_to_token_;
  std::shared_ptr<LayerNorm> param_to_token_norm_;
  torch::Tensor keypoint_2d_embeddings_;  // (26, D)
  torch::Tensor keypoint_3d_embeddings_;
  std::shared_ptr<Mlp> keypoint_2d_pos_encoder_;
  std::shared_ptr<Mlp> keypoint_3d_pos_encoder_;
  std::shared_ptr<Linear> keypoint_2d_feat_linear_;
  std::shared_ptr<Mlp> kp2d_from_tokens_;
  std::shared_ptr<Mlp> kp3d_from_tokens_;
  std::shared_ptr<Linear> image_proj_;  // null when the widths agree
  std::vector<std::shared_ptr<DecoderLayer>> layers_;
  std::shared_ptr<LayerNorm> norm_;
  std::shared_ptr<Mlp> decpose_;
  std::shared_ptr<Mlp> decshape_;
  std::shared_ptr<Mlp> deccam_;
};

}  // namespace q3d::model
