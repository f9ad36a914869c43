#include "model/decoder.h"

namespace q3d::model {
namespace {

constexpr double kNormEpsilon = 1e-5;

// The grid in which the decoder lays out the 192 image tokens.
struct TokenGrid {
  std::int64_t rows, columns;
  double x_scale;  // from crop units to the width that the columns cover
};

// The official decoder reads its image tokens as 12 rows of 16 over the whole crop, although the ViT lays
// them out as 16 rows of 12 over the crop's middle three quarters. The released weights were trained so.
constexpr TokenGrid kOfficialGrid{12, 16, 1.0};
constexpr TokenGrid kTrueGrid{16, 12, 4.0 / 3.0};

const TokenGrid& grid_of(bool true_token_grid) {
  return true_token_grid ? kTrueGrid : kOfficialGrid;
}

// Encodes one axis by sines and cosines: position (N) in [0, 1) -> (N, half).
torch::Tensor encode_axis(const torch::Tensor& position, std::int64_t half) {
  const torch::Tensor exponent =
      torch::arange(half, position.options()) * 2.0 / static_cast<double>(2 * half);
  const torch::Tensor angle = position.unsqueeze(1) / torch::pow(10000.0, exponent);
  const torch::Tensor even = angle.slice(1, 0, half, 2).sin();
  const torch::Tensor odd = angle.slice(1, 1, half, 2).cos();
  return torch::stack({even, odd}, 2).flatten(1);
}

// (192, width) = [y | x]. Official code: PositionalEncoding2D.
torch::Tensor position_encoding(std::int64_t width, const TokenGrid& grid, torch::ScalarType dtype) {
  const torch::Tensor index = torch::arange(grid.rows * grid.columns);
  const torch::Tensor y = torch::floor_divide(index, grid.columns).to(dtype) / grid.rows;
  const torch::Tensor x = torch::remainder(index, grid.columns).to(dtype) / grid.columns;
  return torch::cat({encode_axis(y, width / 2), encode_axis(x, width / 2)}, 1);
}

// Weight of each of `count` cells for a coordinate in [-0.5, 0.5] along one axis: (B, N) -> (B, N, count).
// Linear interpolation between cell centres is a hat function round each centre; outside the grid the hats
// are missing, which is zero padding.
torch::Tensor hat_weights(const torch::Tensor& coordinate, std::int64_t count) {
  const torch::Tensor cell = (coordinate * 2.0 + 1.0) * (static_cast<double>(count) / 2.0) - 0.5;
  const torch::Tensor centres = torch::arange(count, coordinate.options());
  return torch::relu(1.0 - (cell.unsqueeze(2) - centres).abs());
}

// Bilinear samples at xy (B, N, 2) of the grid of tokens source (B, 192, D) -> (B, N, D): F.grid_sample with
// align_corners = False and zero padding, as one matrix product, which is deterministic on every device.
torch::Tensor sample_grid(const torch::Tensor& source, const torch::Tensor& xy, const TokenGrid& grid) {
  const torch::Tensor across = hat_weights(xy.select(2, 0) * grid.x_scale, grid.columns).unsqueeze(2);
  const torch::Tensor down = hat_weights(xy.select(2, 1), grid.rows).unsqueeze(3);
  return torch::bmm((down * across).flatten(2).to(source.scalar_type()), source);
}

// Does the same as apply_mlp for one set of weights for each instance, with leaves of the graph in place of
// the biases.
torch::Tensor apply_taped(const MlpWeights& weights, const torch::Tensor& x, MlpTape& tape) {
  MlpWeights taped = weights;
  taped.hidden_bias = weights.hidden_bias.detach().requires_grad_();
  taped.out_bias = weights.out_bias.detach().requires_grad_();
  const torch::Tensor hidden = torch::relu(affine_each(x, taped.hidden_weight, taped.hidden_bias));
  tape.inputs.push_back(x.detach());
  tape.hidden_biases.push_back(taped.hidden_bias);
  tape.hidden.push_back(hidden.detach());
  tape.out_biases.push_back(taped.out_bias);
  return affine_each(hidden, taped.out_weight, taped.out_bias);
}

}  // namespace

// A post-norm layer: self-attention, cross-attention to the image, feed-forward.
class DecoderLayer : public torch::nn::Module {
 public:
  DecoderLayer(const PrimaConfig& config, const Placement& placement) : dropout_(config.dropout) {
    const std::int64_t width = config.dec_dim;
    const auto norm = [&] { return std::make_shared<LayerNorm>(width, kNormEpsilon, placement); };
    const auto attention = [&] {
      return std::make_shared<MultiheadAttention>(width, config.dec_heads, config.dropout, placement);
    };
    self_attn_ = register_module("self_attn", attention());
    norm1_ = register_module("norm1", norm());
    cross_attn_ = register_module("cross_attn", attention());
    norm2_ = register_module("norm2", norm());
    const auto ffn = register_module("ffn", std::make_shared<torch::nn::Module>());
    ffn_in_ = ffn->register_module("0", std::make_shared<Linear>(width, config.dec_ffn, placement));
    ffn_out_ = ffn->register_module("3", std::make_shared<Linear>(config.dec_ffn, width, placement));
    norm3_ = register_module("norm3", norm());
  }

  KeysValues project_keys_values(const torch::Tensor& image_tokens) const {
    return cross_attn_->project_keys_values(image_tokens);
  }

  // tokens (B, N, D) -> (B, queries, D): the first `queries` tokens only, or all when it is 0.
  torch::Tensor forward(const torch::Tensor& tokens, const KeysValues& keys_values,
                        std::int64_t queries) const {
    const torch::Tensor kept = queries == 0 ? tokens : tokens.narrow(1, 0, queries);
    torch::Tensor x = norm1_->forward(kept + drop(self_attn_->self_attention(tokens, queries)));
    x = norm2_->forward(x + drop(cross_attn_->cross_attention(x, keys_values)));
    const torch::Tensor hidden = drop(ffn_in_->forward(x, Activation::gelu));
    return norm3_->forward(x + drop(ffn_out_->forward(hidden)));
  }

 private:
  torch::Tensor drop(const torch::Tensor& x) const {
    return is_training() && dropout_ > 0.0 ? torch::dropout(x, dropout_, true) : x;
  }

  std::shared_ptr<MultiheadAttention> self_attn_;
  std::shared_ptr<LayerNorm> norm1_;
  std::shared_ptr<MultiheadAttention> cross_attn_;
  std::shared_ptr<LayerNorm> norm2_;
  std::shared_ptr<Linear> ffn_in_;
  std::shared_ptr<Linear> ffn_out_;
  std::shared_ptr<LayerNorm> norm3_;
  double dropout_;
};

// The keypoints that are read from the tokens after a layer, and the features by which they change the input
// of the next layer.
struct Decoder::KeypointUpdate {
  torch::Tensor keypoints_2d;  // (B, 26, 2) crop units
  torch::Tensor keypoints_3d;  // (B, 26, 3)
  torch::Tensor features_2d;   // (B, 26, D) image features added to the 2D tokens
  torch::Tensor augment_2d;    // (B, 26, D) encoded positions
  torch::Tensor augment_3d;    // (B, 26, D)
};

Decoder::Decoder(const PrimaConfig& config, const Placement& placement)
    : rounds_(config.ief_iterations),
      betas_from_bio_(config.betas_from_bio),
      has_keypoint_tokens_(config.keypoint_tokens),
      true_token_grid_(config.true_token_grid) {
  const std::int64_t width = config.dec_dim;
  const Placement exact = placement.unreduced();
  const auto embedding = [&](const std::string& name) {
    const auto holder = register_module(name, std::make_shared<torch::nn::Module>());
    return holder->register_parameter("weight", torch::empty({kKeypoints, width}, placement.vector()));
  };
  const auto mlp = [&](const std::string& name, std::int64_t in, std::int64_t hidden, std::int64_t out,
                       const Placement& where, double negative_slope = 0.0) {
    return register_module(name, std::make_shared<Mlp>(in, hidden, out, where, negative_slope));
  };
  init_pose_ = register_parameter("init_pose", torch::empty({1, kPose6d}, placement.vector()));
  init_cam_ = register_parameter("init_cam", torch::empty({1, kCamera}, placement.vector()));
  bio_to_betas_init_ = mlp("bio_to_betas_init", config.embed_dim, 256, kBetas, exact, 0.2);
  shape_projector_ = mlp("shape_projector", kBetas, 128, 128, exact);
  const auto to_token = register_module("param_to_token", std::make_shared<torch::nn::Module>());
  param_to_token_ =
      to_token->register_module("0", std::make_shared<Linear>(kPose6d + kBetas + kCamera, width, exact));
  param_to_token_norm_ =
      to_token->register_module("1", std::make_shared<LayerNorm>(width, kNormEpsilon, placement));
  keypoint_2d_embeddings_ = embedding("keypoint_2d_embeddings");
  keypoint_2d_pos_encoder_ = mlp("keypoint_2d_pos_encoder", 2, 256, width, exact);
  keypoint_2d_feat_linear_ =
      register_module("keypoint_2d_feat_linear", std::make_shared<Linear>(width, width, placement));
  keypoint_3d_embeddings_ = embedding("keypoint_3d_embeddings");
  keypoint_3d_pos_encoder_ = mlp("keypoint_3d_pos_encoder", 3, 256, width, exact);
  kp2d_from_tokens_ = mlp("kp2d_from_tokens", width, width, 2, placement);
  kp3d_from_tokens_ = mlp("kp3d_from_tokens", width, width, 3, placement);
  if (config.embed_dim != width) {
    image_proj_ = register_module("image_proj", std::make_shared<Linear>(config.embed_dim, width, placement));
  }
  position_ =
      position_encoding(width, grid_of(true_token_grid_), placement.vector_dtype()).to(placement.vector());
  const auto layers = register_module("layers", std::make_shared<torch::nn::Module>());
  for (std::int64_t i = 0; i < config.dec_layers; ++i) {
    layers_.push_back(
        layers->register_module(std::to_string(i), std::make_shared<DecoderLayer>(config, placement)));
  }
  norm_ = register_module("norm", std::make_shared<LayerNorm>(width, kNormEpsilon, placement));
  decpose_ = mlp("decpose", width, width, kPose6d, exact);
  decshape_ = mlp("decshape", width, width, kBetas, exact);
  deccam_ = mlp("deccam", width, width / 2, kCamera, exact);
}

DecoderMemory Decoder::remember(const torch::Tensor& image_tokens, const Observer& observe) const {
  if (observe) observe("image_pos_encoding", position_);
  const torch::Tensor projected = image_proj_ ? image_proj_->forward(image_tokens) : image_tokens;
  const torch::Tensor placed = projected + position_;
  DecoderMemory memory;
  for (const auto& layer : layers_) memory.keys_values.push_back(layer->project_keys_values(placed));
  // Bilinear sampling is linear, so the projection of samples may come before the sampling; its bias may not,
  // because outside the grid the weights do not sum to 1.
  memory.sampled = keypoint_2d_feat_linear_->multiply(placed);
  return memory;
}

torch::Tensor Decoder::initial_betas(const torch::Tensor& bio_token) const {
  if (!betas_from_bio_) {
    return torch::zeros({bio_token.size(0), kBetas}, position_.options());
  }
  return bio_to_betas_init_->forward(bio_token);
}

torch::Tensor Decoder::shape_feature(const torch::Tensor& betas) const {
  const torch::Tensor feature = shape_projector_->forward(betas);
  return feature / feature.norm(2, 1, /*keepdim=*/true).clamp_min(1e-12);
}

AdaptedParameters Decoder::own_parameters() const {
  return {keypoint_2d_embeddings_, keypoint_3d_embeddings_, decpose_->weights(), decshape_->weights(),
          deccam_->weights()};
}

Decoder::KeypointUpdate Decoder::update_keypoints(const torch::Tensor& tokens,
                                                  const torch::Tensor& sampled_source) const {
  KeypointUpdate update;
  update.keypoints_2d = torch::tanh(kp2d_from_tokens_->forward(tokens.narrow(1, 1, kKeypoints))) * 0.5;
  update.augment_2d = keypoint_2d_pos_encoder_->forward(update.keypoints_2d);
  update.features_2d = sample_grid(sampled_source, update.keypoints_2d, grid_of(true_token_grid_)) +
                       keypoint_2d_feat_linear_->bias;
  update.keypoints_3d = kp3d_from_tokens_->forward(tokens.narrow(1, 1 + kKeypoints, kKeypoints));
  // The position encoder sees the keypoints relative to the mean of the first two (the eyes).
  const torch::Tensor centre = update.keypoints_3d.narrow(1, 0, 2).mean(1, /*keepdim=*/true);
  update.augment_3d = keypoint_3d_pos_encoder_->forward(update.keypoints_3d - centre);
  return update;
}

torch::Tensor Decoder::parameter_token(const DecoderOutput& estimate) const {
  const torch::Tensor values = torch::cat({estimate.pose_6d, estimate.betas, estimate.camera}, 1);
  return torch::relu(param_to_token_norm_->forward(param_to_token_->forward(values)));
}

// Passes tokens (B, 53, D), or (B, 1, D) without keypoint tokens, through all layers. Returns the parameter
// token (B, D). Stores the keypoints that are read on the way.
torch::Tensor Decoder::run_layers(torch::Tensor tokens, const DecoderMemory& memory, DecoderOutput& estimate,
                                  const std::string& prefix, const Observer& observe) const {
  for (std::size_t i = 0; i < layers_.size(); ++i) {
    const bool last = i + 1 == layers_.size();
    // Only the parameter token leaves the last layer, so the other tokens are computed there only for
    // observers.
    tokens = layers_[i]->forward(tokens, memory.keys_values[i], last && !observe ? 1 : 0);
    if (observe) observe(prefix + "layer" + std::to_string(i) + "_tokens", tokens);
    if (last) break;
    if (!has_keypoint_tokens_) continue;
    const KeypointUpdate update = update_keypoints(tokens, memory.sampled);
    if (observe) {
      const std::string name = prefix + "upd" + std::to_string(i) + "_";
      observe(name + "kp2d", update.keypoints_2d);
      observe(name + "kp3d", update.keypoints_3d);
      observe(name + "features_2d", update.features_2d);
      observe(name + "augment_2d", update.augment_2d);
    }
    const torch::Tensor added = torch::cat({update.features_2d + update.augment_2d, update.augment_3d}, 1);
    tokens = torch::cat({tokens.narrow(1, 0, 1), tokens.narrow(1, 1, 2 * kKeypoints) + added}, 1);
    estimate.aux_keypoints_2d = update.keypoints_2d;
    estimate.aux_keypoints_3d = update.keypoints_3d;
  }
  return norm_->forward(tokens.select(1, 0));
}

torch::Tensor Decoder::initial_tokens(const DecoderOutput& estimate,
                                      const AdaptedParameters& parameters) const {
  const torch::Tensor parameter = parameter_token(estimate).unsqueeze(1);
  if (!has_keypoint_tokens_) return parameter;
  const auto for_each = [&](const torch::Tensor& embeddings) {
    return embeddings.expand({parameter.size(0), kKeypoints, embeddings.size(-1)});
  };
  return torch::cat(
      {parameter, for_each(parameters.keypoint_2d_embeddings), for_each(parameters.keypoint_3d_embeddings)},
      1);
}

DecoderOutput Decoder::refine(const DecoderMemory& memory, const torch::Tensor& initial_betas,
                              const AdaptedParameters& parameters, const Observer& observe,
                              HeadTapes* tapes) const {
  const auto apply = [](const MlpWeights& head, const torch::Tensor& x, MlpTape* tape) {
    return tape == nullptr ? apply_mlp(head, x) : apply_taped(head, x, *tape);
  };
  const std::int64_t batch = initial_betas.size(0);
  DecoderOutput estimate;
  estimate.pose_6d = init_pose_.expand({batch, -1});
  estimate.betas = initial_betas;
  estimate.camera = init_cam_.expand({batch, -1});
  if (!has_keypoint_tokens_) {
    estimate.aux_keypoints_2d = torch::zeros({batch, kKeypoints, 2}, initial_betas.options());
    estimate.aux_keypoints_3d = torch::zeros({batch, kKeypoints, 3}, initial_betas.options());
  }
  for (std::int64_t round = 0; round < rounds_; ++round) {
    const std::string prefix = "ief" + std::to_string(round) + "_";
    const torch::Tensor tokens = initial_tokens(estimate, parameters);
    const torch::Tensor readout = run_layers(tokens, memory, estimate, prefix, observe);
    const torch::Tensor pose_change = apply(parameters.pose_head, readout, tapes ? &tapes->pose : nullptr);
    const torch::Tensor betas_change = apply(parameters.shape_head, readout, tapes ? &tapes->shape : nullptr);
    const torch::Tensor camera_change =
        apply(parameters.camera_head, readout, tapes ? &tapes->camera : nullptr);
    if (observe) {
      observe(prefix + "param_token_in", tokens.select(1, 0));
      observe(prefix + "param_token_out", readout);
      observe(prefix + "delta_decpose", pose_change);
      observe(prefix + "delta_decshape", betas_change);
      observe(prefix + "delta_deccam", camera_change);
    }
    estimate.pose_6d = estimate.pose_6d + pose_change;
    estimate.betas = estimate.betas + betas_change;
    estimate.camera = estimate.camera + camera_change;
  }
  return estimate;
}

}  // namespace q3d::model
