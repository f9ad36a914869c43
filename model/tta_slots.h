// Holds the instances that are currently adapted, packed into the first rows of every tensor that they need.
#pragma once

#include <torch/types.h>

#include <vector>

#include "model/adam.h"
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

// The inputs of one instance that a slot needs besides the parameters.
struct SlotInputs {
  DecoderMemory memory;
  torch::Tensor initial_betas;
  KeypointTargets targets;
};

class TtaSlots {
 public:
  // Makes room for `capacity` instances. There are none at first.
  TtaSlots(const AdaptedParameters& initial, std::int64_t capacity);

  std::int64_t capacity() const { return capacity_; }
  std::int64_t size() const { return static_cast<std::int64_t>(instances_.size()); }
  std::int64_t instance(std::int64_t slot) const { return instances_[static_cast<std::size_t>(slot)]; }
  // Steps that the slot's instance has taken.
  std::int64_t steps(std::int64_t slot) const { return steps_[static_cast<std::size_t>(slot)]; }

  // Adds instances behind those that are there, each with a copy of the network's own parameters. inputs: a
  // row for each of them.
  void add(const std::vector<std::int64_t>& instances, const SlotInputs& inputs);

  // Views of the active rows. The embeddings share memory with the store, as leaves of a new graph; the heads
  // need no gradients, because their tapes hold leaves.
  AdaptedParameters parameters(bool embeddings_require_grad) const;
  DecoderMemory memory() const;
  torch::Tensor initial_betas() const;
  KeypointTargets targets() const;

  // One Adam step of all active instances. Gradients in the order of to_list.
  void step(const std::vector<InstanceGradient>& gradients, double learning_rate);

  // The last active instance takes the place of this one, which costs one row's copy.
  void remove(std::int64_t slot);

 private:
  torch::Tensor active(const torch::Tensor& rows) const { return rows.narrow(0, 0, size()); }

  std::int64_t capacity_;
  std::vector<torch::Tensor> initial_;   // one set, in the order of to_list
  std::vector<std::int64_t> instances_;  // slot -> instance
  std::vector<std::int64_t> steps_;      // slot -> steps taken
  std::vector<AdamState> states_;
  SlotInputs inputs_;  // made by the first `add`
};

// The 14 tensors in a fixed order, and back.
std::vector<torch::Tensor> to_list(const AdaptedParameters& parameters);
AdaptedParameters from_list(const std::vector<torch::Tensor>& tensors);

}  // namespace q3d::model
