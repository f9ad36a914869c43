// The instances that are still adapting, packed into the first rows of every tensor they need.
#pragma once

#include <torch/types.h>

#include <vector>

#include "model/decoder.h"

namespace q3d::model {

// x, y (B, 26, 2) crop units, zero where invisible. Masks (B, 26, 1) of 0 and 1: the visible ones, those of
// them that are held out, and the others, which the objective fits.
struct KeypointTargets {
  torch::Tensor xy;
  torch::Tensor visible;
  torch::Tensor held_out;
  torch::Tensor fitted;
};

class TtaSlots {
 public:
  // Every instance gets a copy of the network's own parameters.
  TtaSlots(const AdaptedParameters& initial, DecoderMemory memory, torch::Tensor initial_betas,
           KeypointTargets targets);

  std::int64_t size() const { return static_cast<std::int64_t>(instances_.size()); }
  std::int64_t instance(std::int64_t slot) const { return instances_[static_cast<std::size_t>(slot)]; }

  // Views of the active rows. Parameters share memory with the store, as leaves of a new graph.
  std::vector<torch::Tensor> parameters(bool requires_grad) const;
  DecoderMemory memory() const;
  torch::Tensor initial_betas() const;
  KeypointTargets targets() const;

  // One Adam step of all active instances (0.9, 0.999, 1e-8, no weight decay).
  void step(const std::vector<torch::Tensor>& gradients, double learning_rate);

  // The last active instance takes the place of this one, which costs one row's copy.
  void remove(std::int64_t slot);

 private:
  torch::Tensor active(const torch::Tensor& rows) const { return rows.narrow(0, 0, size()); }

  std::vector<std::int64_t> instances_;  // slot -> instance
  std::vector<torch::Tensor> parameters_, first_moments_, second_moments_;
  std::vector<torch::Tensor> step_counts_;  // one scalar a parameter, as the fused kernel wants them
  DecoderMemory memory_;
  torch::Tensor initial_betas_;
  KeypointTargets targets_;
};

// The 14 tensors in a fixed order, and back.
std::vector<torch::Tensor> to_list(const AdaptedParameters& parameters);
AdaptedParameters from_list(const std::vector<torch::Tensor>& tensors);

}  // namespace q3d::model
