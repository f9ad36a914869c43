// Fresh weights. A seed gives the same bytes on every machine.
#include "model/init.h"

#include <cmath>
#include <map>
#include <optional>
#include <stdexcept>
#include <string_view>

#include "model/efficientnet_lite.h"
#include "model/pretrained_stem.h"
#include "model/prima.h"
#include "model/seeded_uniform.h"

namespace q3d::model {
namespace {

constexpr double kPositionScale = 0.5;    // beside patch embeddings of about 0.6
constexpr double kLongestPosition = 100;  // slowest wave over fastest: a few times the grid

constexpr double kEmbeddingStd = 0.02;
constexpr double kHeadGain =
    0.01;  // a fresh head begins at the initial pose and camera (Kanazawa et al. 2018)

bool ends_with(std::string_view name, std::string_view end) {
  return name.size() >= end.size() && name.substr(name.size() - end.size()) == end;
}

bool contains(std::string_view name, std::string_view part) {
  return name.find(part) != std::string_view::npos;
}

// Returns whether a tensor belongs to a layer norm, a group norm, or a norm of an EfficientNet.
bool is_norm(std::string_view name) {
  return contains(name, "norm") || contains(name_in_efficientnet(name), "_bn") || contains(name, ".ln_") ||
         contains(name, "projection.1.") || contains(name, "param_to_token.1.");
}

bool is_embedding(std::string_view name) {
  return contains(name, "embed") && (ends_with(name, "pos_embed") || ends_with(name, "_embedding") ||
                                     ends_with(name, "_embeddings.weight"));
}

bool is_last_of_head(std::string_view name) {
  return ends_with(name, "decpose.2.weight") || ends_with(name, "decshape.2.weight") ||
         ends_with(name, "deccam.2.weight") || ends_with(name, "bio_to_betas_init.2.weight");
}

// Followed by a ReLU: He et al. 2015.
bool is_stem_convolution(const TensorSpec& spec) {
  const bool in_stem = contains(spec.name, ".stem.") || !name_in_efficientnet(spec.name).empty();
  return in_stem && spec.shape.size() == 4;
}

// Returns the bound of the uniform distribution for a tensor that is neither constant nor a norm. Embeddings
// get the official standard deviation, matrices follow the fan-in rule of torch.nn.Linear, and the bound of
// biases is zero.
double uniform_bound(const TensorSpec& spec) {
  if (is_embedding(spec.name)) return std::sqrt(3.0) * kEmbeddingStd;
  if (spec.shape.size() < 2) return 0.0;
  double fan_in = 1.0;
  for (std::size_t i = 1; i < spec.shape.size(); ++i) fan_in *= static_cast<double>(spec.shape[i]);
  // CLIP multiplies by its last projection from the left, so its rows are the inputs.
  if (ends_with(spec.name, "visual.proj")) fan_in = static_cast<double>(spec.shape[0]);
  if (is_stem_convolution(spec)) return std::sqrt(6.0 / fan_in);
  const double gain = is_last_of_head(spec.name) ? kHeadGain : 1.0;
  return gain / std::sqrt(fan_in);
}

// Sines and cosines of a token's row and column, a quarter of the width each, after a first row of zeros for
// the class token: (1 + rows * columns, width). A ViT that starts with them knows which tokens are
// neighbours; with random positions it would have to learn this (Vaswani et al. 2017; Chen et al. 2021, MoCo
// v3).
torch::Tensor grid_positions(std::int64_t rows, std::int64_t columns, std::int64_t width) {
  torch::Tensor positions = torch::zeros({1 + rows * columns, width});
  const std::int64_t waves = width / 4;
  auto numbers = positions.accessor<float, 2>();
  for (std::int64_t token = 0; token < rows * columns; ++token) {
    for (std::int64_t i = 0; i < waves; ++i) {
      const double frequency =
          std::pow(kLongestPosition, -static_cast<double>(i) / static_cast<double>(waves));
      const double row = frequency * static_cast<double>(token / columns);
      const double column = frequency * static_cast<double>(token % columns);
      float* out = &numbers[1 + token][i];
      out[0] = static_cast<float>(kPositionScale * std::sin(row));
      out[waves] = static_cast<float>(kPositionScale * std::cos(row));
      out[2 * waves] = static_cast<float>(kPositionScale * std::sin(column));
      out[3 * waves] = static_cast<float>(kPositionScale * std::cos(column));
    }
  }
  return positions;
}

}  // namespace

torch::Tensor initial_tensor(const TensorSpec& spec, std::uint64_t seed) {
  if (ends_with(spec.name, "init_pose")) {
    // The identity in 6D, columns (1, 0, 0) and (0, 1, 0), for all joints but the root. The body's y points
    // up and the camera's down, so a body at the identity hangs upside down, and no gradient turns it: half
    // way its 6D column vanishes, and training bends the spine over instead.
    torch::Tensor pose = torch::tensor({1.0F, 0.0F, 0.0F, 0.0F, 1.0F, 0.0F}).repeat({1, kPose6d / 6});
    pose[0][4] = -1.0F;
    return pose;
  }
  if (ends_with(spec.name, "init_cam")) return torch::tensor({{0.9F, 0.0F, 0.0F}});
  if (ends_with(spec.name, "backbone.pos_embed")) {
    return grid_positions(kTokenRows, kTokenColumns, spec.shape[2]).unsqueeze(0);
  }
  if (ends_with(spec.name, "visual.positional_embedding")) {
    const auto side = static_cast<std::int64_t>(std::lround(std::sqrt(spec.shape[0] - 1)));
    return grid_positions(side, side, spec.shape[1]);
  }
  if (is_norm(spec.name)) {
    return ends_with(spec.name, ".weight") ? torch::ones(spec.shape) : torch::zeros(spec.shape);
  }
  torch::Tensor tensor = torch::empty(spec.shape);
  fill_uniform(tensor, uniform_bound(spec), seed, spec.name);
  return tensor;
}

void initialise(PrimaNet& net, std::uint64_t seed) {
  const at::NoGradGuard no_grad;
  for (auto& parameter : net.named_parameters()) {
    parameter.value().copy_(initial_tensor({parameter.key(), parameter.value().sizes().vec()}, seed));
  }
}

void write_initial_checkpoint(const std::filesystem::path& path, const PrimaConfig& config,
                              std::uint64_t seed, torch::ScalarType dtype,
                              const std::filesystem::path& stem) {
  std::optional<PretrainedStem> pretrained;
  if (!stem.empty()) {
    if (!config.efficientnet_stem && !config.clip_efficientnet_stem) {
      throw std::invalid_argument(stem.string() +
                                  ": a pre-trained stem, but a network of this size has none (\"lite\" has)");
    }
    pretrained.emplace(stem);
  }
  smal::tensors::NamedTensors tensors;
  for (const TensorSpec& spec : expected_tensors(config)) {
    const torch::Tensor known = pretrained ? pretrained->values(spec) : torch::Tensor();
    tensors.emplace_back(spec.name, (known.defined() ? known : initial_tensor(spec, seed)).to(dtype));
  }
  write_checkpoint(path, config, tensors,
                   pretrained ? pretrained->origin() : std::map<std::string, std::string>{});
}

}  // namespace q3d::model
