#include "model/encoder_trainer.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "model/batch_in_parts.h"
#include "model/decoder.h"
#include "model/init.h"
#include "model/mixed_precision.h"
#include "model/module_state.h"
#include "model/partial_mean.h"
#include "smal/camera.h"

namespace q3d::model {
namespace {

constexpr const char* kHeads = "training.heads.";
constexpr const char* kOptimiser = "training.optimiser.";
constexpr const char* kSteps = "training.steps";

// The ViT sees columns 32 to 224 of the 256-px crop, in patches of 16 px that begin 2 px before the edge.
constexpr double kCropPx = smal::kCropSidePx;
constexpr double kPatchPx = 16.0;
constexpr double kFirstCentrePx = kPatchPx / 2 - 2.0;
constexpr double kLeftPx = 32.0;

// Bilinear share of each of `count` positions in coordinate `at` (...) -> (..., count).
torch::Tensor hat(const torch::Tensor& at, std::int64_t count) {
  const torch::Tensor centres = torch::arange(count, at.options());
  const torch::Tensor clamped = at.clamp(0.0, static_cast<double>(count - 1)).unsqueeze(-1);
  return (1.0 - (clamped - centres).abs()).clamp_min(0.0);
}

// Returns the mean loss of the samples whose species is known.
PartialMean species_loss(const torch::Tensor& logits, const torch::Tensor& species) {
  const torch::Tensor known = (species >= 0).to(logits.scalar_type());
  const torch::Tensor log_shares = torch::log_softmax(logits, 1);
  const torch::Tensor chosen = log_shares.gather(1, species.clamp_min(0).unsqueeze(1)).squeeze(1);
  return {-(chosen * known).sum(), known.sum()};
}

PartialMean accuracy(const torch::Tensor& logits, const torch::Tensor& species) {
  const torch::Tensor right = logits.argmax(1) == species;  // -1 is never right
  return {right.sum().to(torch::kFloat32), (species >= 0).sum().to(torch::kFloat32)};
}

// Returns the mean loss of the keypoints, by their weights.
PartialMean keypoint_loss(const torch::Tensor& logits, const TokenTargets& targets) {
  const torch::Tensor log_shares = torch::log_softmax(logits, 1).transpose(1, 2);  // (B, 26, 192)
  return {-((log_shares * targets.share).sum(2) * targets.weight).sum(), targets.weight.sum()};
}

}  // namespace

class EncoderTrainer::Heads : public torch::nn::Module {
 public:
  Heads(const PrimaConfig& config, std::int64_t species, const Placement& placement, std::uint64_t seed) {
    keypoints =
        register_module("keypoints", std::make_shared<Linear>(config.embed_dim, kKeypoints, placement));
    backbone = register_module("backbone", std::make_shared<Linear>(config.embed_dim, species, placement));
    bioclip = register_module("bioclip", std::make_shared<Linear>(config.clip_out, species, placement));
    const at::NoGradGuard no_grad;
    for (auto& parameter : named_parameters()) {
      parameter.value().copy_(
          initial_tensor({"heads." + parameter.key(), parameter.value().sizes().vec()}, seed));
    }
  }

  std::shared_ptr<Linear> keypoints, backbone, bioclip;
};

TokenTargets token_targets(const torch::Tensor& keypoints) {
  const torch::Tensor x_px = (keypoints.select(2, 0) + 0.5) * kCropPx - kLeftPx;
  const torch::Tensor y_px = (keypoints.select(2, 1) + 0.5) * kCropPx;
  const torch::Tensor column = (x_px - kFirstCentrePx) / kPatchPx;
  const torch::Tensor row = (y_px - kFirstCentrePx) / kPatchPx;
  const torch::Tensor inside =
      (column > -0.5) & (column < kTokenColumns - 0.5) & (row > -0.5) & (row < kTokenRows - 0.5);
  return {(hat(row, kTokenRows).unsqueeze(3) * hat(column, kTokenColumns).unsqueeze(2)).flatten(2),
          keypoints.select(2, 2) * inside};
}

EncoderTrainer::EncoderTrainer(std::shared_ptr<PrimaNet> net, const EncoderTrainerOptions& options,
                               std::shared_ptr<const ranks::Collective> ranks)
    : net_(std::move(net)), options_(options), ranks_(std::move(ranks)), optimiser_({}, options.adamw) {
  if (net_->placement().matrix_dtype != torch::kFloat32) {
    throw std::invalid_argument("encoder trainer: the network must hold float32 weights");
  }
  if (options_.species < 2) {
    throw std::invalid_argument(fmt::format(
        "encoder trainer: {} species in the pools; naming the species needs at least two", options_.species));
  }
  heads_ = std::make_shared<Heads>(net_->config(), options_.species, net_->placement(), options_.seed);
  net_->train();
  std::vector<ParameterGroup> groups = encoder_groups(*net_, options_.stem);
  for (auto& parameter : heads_->named_parameters()) {
    groups.front().parameters.emplace_back(kHeads + parameter.key(), parameter.value());
  }
  optimiser_ = AdamW(std::move(groups), options_.adamw);
  backward_ = ranks_->averaged_backward(optimiser_.parameters());
}

std::vector<torch::Tensor> EncoderTrainer::pass(const torch::Tensor& images) const {
  const MixedPrecision mixed(images.device(), options_.precision == Precision::bfloat16);
  const torch::Tensor tokens = net_->image_tokens(images);
  const torch::Tensor keypoints = heads_->keypoints->forward(tokens);
  const torch::Tensor backbone = heads_->backbone->forward(tokens.mean(1));
  const torch::Tensor bioclip = heads_->bioclip->forward(net_->bioclip().features(images));
  return {keypoints.to(torch::kFloat32), backbone.to(torch::kFloat32), bioclip.to(torch::kFloat32)};
}

StepReport EncoderTrainer::step(const TrainingBatch& batch) {
  const torch::Device device = net_->placement().device;
  const torch::Tensor species = batch.species.to(device);
  if (species.max().item<std::int64_t>() >= options_.species) {
    throw std::invalid_argument("encoder trainer: a species number beyond the list");
  }
  optimiser_.zero_grad();
  BatchInParts parts([this](const torch::Tensor& images) { return pass(images); }, batch.images.to(device),
                     options_.parts);
  const torch::Tensor& keypoint_logits = parts.outputs()[0];
  const torch::Tensor& backbone_species = parts.outputs()[1];
  const torch::Tensor& bioclip_species = parts.outputs()[2];
  PartialMean keypoints =
      keypoint_loss(keypoint_logits, token_targets(batch.targets.keypoints_2d.to(device)));
  PartialMean backbone = species_loss(backbone_species, species);
  PartialMean bioclip = species_loss(bioclip_species, species);
  PartialMean backbone_accuracy = accuracy(backbone_species, species);
  PartialMean bioclip_accuracy = accuracy(bioclip_species, species);
  join_means({&keypoints, &backbone, &bioclip, &backbone_accuracy, &bioclip_accuracy}, *ranks_);
  const torch::Tensor loss = keypoints.value() + backbone.value() + bioclip.value();
  parts.backward(loss, *backward_);
  const torch::Tensor norm = optimiser_.gradient_norm();
  const std::vector<double> values = ranks::mean_over_ranks(
      *ranks_, to_host({loss, norm, keypoints.value(), backbone.value(), bioclip.value(),
                        backbone_accuracy.value(), bioclip_accuracy.value()}));
  StepReport report;
  report.loss = values[0];
  report.gradient_norm = values[1];
  report.learning_rate = rate_at(options_.schedule, steps_);
  report.terms = {{"token_keypoints", values[2]},
                  {"backbone_species", values[3]},
                  {"bioclip_species", values[4]},
                  {"backbone_accuracy", values[5]},
                  {"bioclip_accuracy", values[6]}};
  if (!std::isfinite(report.loss) || !std::isfinite(report.gradient_norm)) return report;
  if (options_.largest_gradient_norm > 0.0) optimiser_.clip(norm, options_.largest_gradient_norm);
  optimiser_.step(report.learning_rate);
  ++steps_;
  report.applied = true;
  return report;
}

smal::tensors::NamedTensors EncoderTrainer::state() const {
  smal::tensors::NamedTensors state;
  append_parameters(state, "", *net_);
  append_parameters(state, kHeads, *heads_);
  optimiser_.append_state(state, kOptimiser);
  state.emplace_back(kSteps, torch::tensor(steps_, torch::kInt64));
  return state;
}

void EncoderTrainer::restore(const smal::tensors::SafeTensors& file) {
  restore_parameters(file, "", *net_);
  restore_parameters(file, kHeads, *heads_);
  optimiser_.restore_state(file, kOptimiser);
  steps_ = restored_like(file, kSteps, torch::zeros({}, torch::kInt64)).item<std::int64_t>();
}

}  // namespace q3d::model
