// The training step takes a batch of tensors, computes the losses and updates the weights. Paper section
// "Model training"; official code: PRIMA.training_step and training_step_discriminator.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <memory>
#include <optional>

#include "model/discriminator.h"
#include "model/learner.h"
#include "model/net.h"
#include "model/optimiser.h"
#include "model/priors.h"
#include "model/ranks/collective.h"
#include "smal/tensors/body.h"

namespace q3d::model {

struct TrainerOptions {
  settings::LossWeights weights;
  settings::LossVariant variant = settings::LossVariant::sound;
  AdamWOptions adamw;
  double backbone_rate_scale = kBackboneRateScale;  // of the schedule's rate
  StemTraining stem;
  RateSchedule schedule;
  double largest_gradient_norm = 0.0;  // longer gradients are scaled down to it; 0 = never
  Precision precision = Precision::float32;
  int parts = 1;             // of a batch, computed one after the other (BatchInParts)
  bool adversarial = false;  // train a discriminator along; the paper does so in the warm-up
  std::uint64_t seed = 0;    // of the discriminator's weights
};

class Trainer : public Learner {
 public:
  // Switches the net to training mode and gives gradients to what learns. Net, body and priors must be on one
  // device. Of several ranks all must start with the same weights. Throws std::invalid_argument otherwise, or
  // when the net does not hold float32.
  Trainer(std::shared_ptr<PrimaNet> net, smal::tensors::SmalBody body, Priors priors,
          const TrainerOptions& options,
          std::shared_ptr<const ranks::Collective> ranks = ranks::single_rank());

  // Also throws for a family that the priors lack.
  StepReport step(const TrainingBatch& batch) override;

  std::int64_t steps() const { return steps_; }
  PrimaNet& net() const override { return *net_; }

  smal::tensors::NamedTensors state() const override;
  void restore(const smal::tensors::SafeTensors& file) override;

 private:
  std::vector<torch::Tensor> pass(const torch::Tensor& images) const;
  Prediction predicted(const std::vector<torch::Tensor>& outputs) const;
  torch::Tensor step_discriminator(const Prediction& prediction, const Targets& targets,
                                   double learning_rate);

  std::shared_ptr<PrimaNet> net_;
  smal::tensors::SmalBody body_;
  Priors priors_;
  TrainerOptions options_;
  std::shared_ptr<const ranks::Collective> ranks_;
  AdamW optimiser_;
  std::unique_ptr<ranks::AveragedBackward> backward_;
  std::shared_ptr<Discriminator> discriminator_;  // null without the adversarial loss
  std::optional<AdamW> discriminator_optimiser_;
  std::unique_ptr<ranks::AveragedBackward> discriminator_backward_;
  std::int64_t steps_ = 0;
};

// The same weights in a network of other switches or rounds; the sizes must agree (std::invalid_argument).
std::shared_ptr<PrimaNet> with_config(const PrimaNet& net, const PrimaConfig& config);

}  // namespace q3d::model
