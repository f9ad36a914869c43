#include "model/trainer.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "model/assemble.h"
#include "model/batch_in_parts.h"
#include "model/mixed_precision.h"
#include "model/module_state.h"
#include "smal/camera.h"

namespace q3d::model {
namespace {

constexpr const char* kOptimiser = "training.optimiser.";
constexpr const char* kDiscriminator = "discriminator.";  // the official name
constexpr const char* kDiscriminatorOptimiser = "training.discriminator_optimiser.";
constexpr const char* kSteps = "training.steps";

void require(bool holds, const std::string& message) {
  if (!holds) throw std::invalid_argument("trainer: " + message);
}

torch::Tensor body_joints(const torch::Tensor& rotations) {
  return rotations.narrow(1, 1, rotations.size(1) - 1);
}

// The terms are in the order of the log's columns.
std::vector<std::pair<std::string, torch::Tensor>> named_terms(const LossTerms& terms) {
  return {{"keypoints_2d", terms.keypoints_2d},
          {"keypoints_3d", terms.keypoints_3d},
          {"aux_keypoints_2d", terms.aux_keypoints_2d},
          {"aux_keypoints_3d", terms.aux_keypoints_3d},
          {"global_orient", terms.global_orient},
          {"pose", terms.pose},
          {"betas", terms.betas},
          {"pose_prior", terms.pose_prior.value()},
          {"shape_prior", terms.shape_prior.value()},
          {"initial_shape_prior", terms.initial_shape_prior.value()},
          {"contrastive", terms.contrastive.value()}};
}

ParameterGroup discriminator_group(const Discriminator& discriminator) {
  ParameterGroup group;
  for (const auto& parameter : discriminator.named_parameters()) {
    group.parameters.emplace_back(parameter.key(), parameter.value());
  }
  return group;
}

void check_batch(const TrainingBatch& batch, const Priors& priors) {
  check_targets(batch.targets);
  const std::int64_t size = batch.targets.family.size(0);
  require(size > 0, "the batch is empty");
  require(batch.images.sizes() == at::IntArrayRef({size, 3, smal::kCropSidePx, smal::kCropSidePx}) &&
              batch.images.scalar_type() == torch::kFloat32,
          fmt::format("images: expected ({}, 3, 256, 256) float32, got {} dimensions, {} numbers", size,
                      batch.images.dim(), batch.images.numel()));
  const auto family = batch.targets.family.max().item<std::int64_t>();
  require(family < priors.mean_betas.size(0),
          fmt::format("family {} in a batch, but the shape prior has {} families", family,
                      priors.mean_betas.size(0)));
}

}  // namespace

Trainer::Trainer(std::shared_ptr<PrimaNet> net, smal::tensors::SmalBody body, Priors priors,
                 const TrainerOptions& options, std::shared_ptr<const ranks::Collective> ranks)
    : net_(std::move(net)),
      body_(std::move(body)),
      priors_(std::move(priors)),
      options_(options),
      ranks_(std::move(ranks)),
      optimiser_(parameter_groups(*net_, options.backbone_rate_scale, options.stem), options.adamw),
      backward_(ranks_->averaged_backward(optimiser_.parameters())) {
  const torch::Device device = net_->placement().device;
  require(net_->placement().matrix_dtype == torch::kFloat32, "the network must hold float32 weights");
  require(body_.device() == device && priors_.precs.device() == device,
          fmt::format("the network is on {}, the body on {}, the priors on {}", device.str(),
                      body_.device().str(), priors_.precs.device().str()));
  net_->train();
  if (!net_->config().keypoint_tokens) {  // such a network has no auxiliary keypoints to teach
    options_.weights.aux_keypoints_2d = 0.0;
    options_.weights.aux_keypoints_3d = 0.0;
  }
  if (!options_.adversarial) return;
  discriminator_ = std::make_shared<Discriminator>(Placement{device, torch::kFloat32});
  initialise(*discriminator_, options_.seed);
  discriminator_optimiser_.emplace(std::vector{discriminator_group(*discriminator_)}, options_.adamw);
  discriminator_backward_ = ranks_->averaged_backward(discriminator_optimiser_->parameters());
}

// Returns the fields of the decoder's output in their order, initial betas and shape features.
std::vector<torch::Tensor> Trainer::pass(const torch::Tensor& images) const {
  torch::Tensor initial_betas;
  DecoderOutput output;
  const Decoder& decoder = net_->decoder();
  {
    const MixedPrecision mixed(body_.device(), options_.precision == Precision::bfloat16);
    const ImageFeatures features = net_->encode(images);
    initial_betas = decoder.initial_betas(features.bio_token).to(torch::kFloat32);
    output = decoder.refine(decoder.remember(features.image_tokens), initial_betas, decoder.own_parameters());
  }
  std::vector<torch::Tensor> outputs{output.pose_6d, output.betas, output.camera, output.aux_keypoints_2d,
                                     output.aux_keypoints_3d};
  for (torch::Tensor& tensor : outputs) tensor = tensor.to(torch::kFloat32);
  outputs.push_back(initial_betas);
  outputs.push_back(decoder.shape_feature(initial_betas));
  return outputs;
}

// Returns the bodies of what pass() returns.
Prediction Trainer::predicted(const std::vector<torch::Tensor>& outputs) const {
  const DecoderOutput output{outputs[0], outputs[1], outputs[2], outputs[3], outputs[4]};
  Prediction prediction =
      assemble_body(body_, output, outputs[5], net_->config().focal_px, /*with_vertices=*/false);
  prediction.shape_feature = outputs[6];
  return prediction;
}

StepReport Trainer::step(const TrainingBatch& batch) {
  check_batch(batch, priors_);
  const Targets targets = to_device(batch.targets, body_.device());
  optimiser_.zero_grad();

  BatchInParts parts([this](const torch::Tensor& images) { return pass(images); },
                     batch.images.to(body_.device()), options_.parts);
  const Prediction prediction = predicted(parts.outputs());
  const LossTerms terms = loss_terms(prediction, targets, priors_, options_.variant, *ranks_);
  torch::Tensor loss = total_loss(terms, options_.weights);
  auto named = named_terms(terms);
  if (discriminator_) {  // a mean over the batch, of parts of equal size
    const torch::Tensor adversarial =
        adversarial_loss(discriminator_->forward(body_joints(prediction.rotations), prediction.betas));
    loss = loss + options_.weights.adversarial * adversarial;
    named.emplace_back("adversarial", adversarial);
  }
  parts.backward(loss, *backward_);
  const torch::Tensor norm = optimiser_.gradient_norm();

  std::vector<torch::Tensor> scalars{loss, norm};
  for (const auto& [name, term] : named) scalars.push_back(term);
  const std::vector<double> values = ranks::mean_over_ranks(*ranks_, to_host(scalars));
  StepReport report;
  report.loss = values[0];
  report.gradient_norm = values[1];
  report.learning_rate = rate_at(options_.schedule, steps_);
  for (std::size_t i = 0; i < named.size(); ++i) report.terms.emplace_back(named[i].first, values[i + 2]);
  if (!std::isfinite(report.loss) || !std::isfinite(report.gradient_norm)) return report;

  if (options_.largest_gradient_norm > 0.0) optimiser_.clip(norm, options_.largest_gradient_norm);
  optimiser_.step(report.learning_rate);
  if (discriminator_) {
    const torch::Tensor own = step_discriminator(prediction, targets, report.learning_rate);
    report.terms.emplace_back("discriminator", ranks::mean_over_ranks(*ranks_, {own.item<double>()}).front());
  }
  ++steps_;
  report.applied = true;
  return report;
}

// Learns to tell the true bodies of the batch from the predicted ones.
torch::Tensor Trainer::step_discriminator(const Prediction& prediction, const Targets& targets,
                                          double learning_rate) {
  discriminator_optimiser_->zero_grad();  // the network's loss left gradients here too
  const torch::Tensor predicted =
      discriminator_->forward(body_joints(prediction.rotations).detach(), prediction.betas.detach());
  const torch::Tensor real = discriminator_->forward(body_joints(targets.rotations), targets.betas);
  const torch::Tensor is_real = options_.variant == settings::LossVariant::official
                                    ? torch::ones_like(targets.has_pose)
                                    : targets.has_pose * targets.has_betas;
  const torch::Tensor loss = discriminator_loss(predicted, real, is_real);
  discriminator_backward_->run(loss);
  discriminator_optimiser_->step(learning_rate);
  return loss.detach();
}

smal::tensors::NamedTensors Trainer::state() const {
  smal::tensors::NamedTensors state;
  append_parameters(state, "", *net_);
  optimiser_.append_state(state, kOptimiser);
  if (discriminator_) {
    append_parameters(state, kDiscriminator, *discriminator_);
    discriminator_optimiser_->append_state(state, kDiscriminatorOptimiser);
  }
  state.emplace_back(kSteps, torch::tensor(steps_, torch::kInt64));
  return state;
}

void Trainer::restore(const smal::tensors::SafeTensors& file) {
  restore_parameters(file, "", *net_);
  optimiser_.restore_state(file, kOptimiser);
  if (discriminator_) {
    restore_parameters(file, kDiscriminator, *discriminator_);
    discriminator_optimiser_->restore_state(file, kDiscriminatorOptimiser);
  }
  steps_ = restored_like(file, kSteps, torch::zeros({}, torch::kInt64)).item<std::int64_t>();
}

std::shared_ptr<PrimaNet> with_config(const PrimaNet& net, const PrimaConfig& config) {
  const at::NoGradGuard no_grad;
  auto result = std::make_shared<PrimaNet>(config, net.placement());
  const auto from = net.named_parameters();
  for (auto& parameter : result->named_parameters()) {
    const torch::Tensor* source = from.find(parameter.key());
    require(source != nullptr && source->sizes() == parameter.value().sizes(),
            fmt::format("{} has another shape in the other config", parameter.key()));
    parameter.value().copy_(*source);
  }
  return result;
}

}  // namespace q3d::model
