// The training step: a batch of tensors in, losses out, weights moved. Paper section "Model training";
// official code: PRIMA.training_step and training_step_discriminator.
#pragma once

#include <torch/torch.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "model/discriminator.h"
#include "model/losses.h"
#include "model/net.h"
#include "model/optimiser.h"
#include "model/priors.h"
#include "smal/body.h"

namespace q3d::model {

struct TrainingBatch {
  torch::Tensor images;  // (B, 3, 256, 256) float32, normalised
  Targets targets;
};

enum class Precision { float32, bfloat16 };  // of the forward pass; weights and losses are float32

struct TrainerOptions {
  LossWeights weights;
  LossVariant variant = LossVariant::sound;
  AdamWOptions adamw;
  RateSchedule schedule;
  double largest_gradient_norm = 0.0;  // longer gradients are scaled down to it; 0 = never
  Precision precision = Precision::float32;
  bool adversarial = false;  // train a discriminator along; the paper does so in the warm-up
  std::uint64_t seed = 0;    // of the discriminator's weights
};

struct StepReport {
  double loss = 0.0;                                  // weighted total
  std::vector<std::pair<std::string, double>> terms;  // not weighted, in a fixed order
  double gradient_norm = 0.0;                         // before clipping
  double learning_rate = 0.0;
  // False when loss or gradient are not finite. Then no weight was changed and the step does not count.
  bool applied = false;
};

class Trainer {
 public:
  // Switches the net to training mode and gives gradients to what learns. Net, body and priors must be on one
  // device. Throws std::invalid_argument otherwise, or when the net does not hold float32.
  Trainer(std::shared_ptr<PrimaNet> net, smal::SmalBody body, Priors priors, const TrainerOptions& options);

  // Tensors of the batch may be on any device. Throws std::invalid_argument on wrong shapes, or a family that
  // the priors lack.
  StepReport step(const TrainingBatch& batch);

  std::int64_t steps() const { return steps_; }
  PrimaNet& net() const { return *net_; }

  // All that the next step depends on but the batch: weights under their official names, and under
  // "training." the optimisers, the step count and LibTorch's random generators. A trainer that restores it
  // goes on bit for bit.
  smal::NamedTensors state() const;
  // Throws std::runtime_error naming the tensor, got and expected.
  void restore(const smal::SafeTensors& file);

 private:
  Prediction predict(const torch::Tensor& images) const;
  torch::Tensor step_discriminator(const Prediction& prediction, const Targets& targets,
                                   double learning_rate);

  std::shared_ptr<PrimaNet> net_;
  smal::SmalBody body_;
  Priors priors_;
  TrainerOptions options_;
  AdamW optimiser_;
  std::shared_ptr<Discriminator> discriminator_;  // null without the adversarial loss
  std::optional<AdamW> discriminator_optimiser_;
  std::int64_t steps_ = 0;
};

// The same weights in a network of other switches or rounds; the sizes must agree (std::invalid_argument).
std::shared_ptr<PrimaNet> with_config(const PrimaNet& net, const PrimaConfig& config);

}  // namespace q3d::model
