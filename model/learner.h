// The interface of everything that a training run can train. A learner takes one step at a time, and its
// state can be restored bit for bit.
#pragma once

#include <torch/types.h>

#include <string>
#include <utility>
#include <vector>

#include "model/losses.h"
#include "model/net.h"
#include "model/ranks/collective.h"
#include "smal/tensors/safetensors.h"

namespace q3d::model {

// With several ranks, each rank holds its part of the joint batch. The parts must be of equal size.
struct TrainingBatch {
  torch::Tensor images;  // (B, 3, 256, 256) float32, normalised
  Targets targets;
  torch::Tensor species;  // (B) int64: number in a list of names, -1 unknown; read by EncoderTrainer alone
};

enum class Precision { float32, bfloat16 };  // of the forward pass; weights and losses are float32

// The numbers are those of the joint batch, so they are equal on all ranks.
struct StepReport {
  double loss = 0.0;                                  // weighted total
  std::vector<std::pair<std::string, double>> terms;  // not weighted, in a fixed order
  double gradient_norm = 0.0;                         // before clipping
  double learning_rate = 0.0;
  // False when loss or gradient are not finite. Then no weight was changed and the step does not count.
  bool applied = false;
};

class Learner {
 public:
  Learner() = default;
  Learner(const Learner&) = delete;
  Learner& operator=(const Learner&) = delete;
  virtual ~Learner() = default;

  virtual PrimaNet& net() const = 0;

  // Tensors of the batch may be on any device. Dropout and stochastic depth draw from LibTorch's default
  // generator. Throws std::invalid_argument on wrong shapes or labels, std::runtime_error when another rank
  // is gone.
  virtual StepReport step(const TrainingBatch& batch) = 0;

  // Returns everything on which the next step depends except the batch and the random generator: weights
  // under their official names, and optimisers and step count under "training.". It is equal on all ranks.
  virtual smal::tensors::NamedTensors state() const = 0;
  // Throws std::runtime_error naming the tensor, got and expected.
  virtual void restore(const smal::tensors::SafeTensors& file) = 0;
};

// Copies all scalars from the device in one transfer.
std::vector<double> to_host(const std::vector<torch::Tensor>& scalars);

}  // namespace q3d::model
