#include "model/tta_slots.h"

#include <algorithm>
#include <utility>

namespace q3d::model {
namespace {

// The tensors of the inputs in a fixed order: with a row for each slot.
std::vector<torch::Tensor*> tensors_of(SlotInputs& inputs) {
  std::vector<torch::Tensor*> tensors{&inputs.memory.sampled,   &inputs.initial_betas,
                                      &inputs.targets.xy,       &inputs.targets.visible,
                                      &inputs.targets.held_out, &inputs.targets.fitted};
  for (KeysValues& layer : inputs.memory.keys_values) {
    tensors.push_back(&layer.keys);
    tensors.push_back(&layer.values);
  }
  return tensors;
}

torch::Tensor room_for(const torch::Tensor& rows, std::int64_t capacity) {
  std::vector<std::int64_t> sizes = rows.sizes().vec();
  sizes[0] = capacity;
  return torch::empty(sizes, rows.options());
}

}  // namespace

std::vector<torch::Tensor> to_list(const AdaptedParameters& parameters) {
  std::vector<torch::Tensor> tensors{parameters.keypoint_2d_embeddings, parameters.keypoint_3d_embeddings};
  for (const MlpWeights* head : {&parameters.pose_head, &parameters.shape_head, &parameters.camera_head}) {
    for (const auto& tensor : {head->hidden_weight, head->hidden_bias, head->out_weight, head->out_bias}) {
      tensors.push_back(tensor);
    }
  }
  return tensors;
}

AdaptedParameters from_list(const std::vector<torch::Tensor>& t) {
  return {t.at(0),
          t.at(1),
          {t.at(2), t.at(3), t.at(4), t.at(5)},
          {t.at(6), t.at(7), t.at(8), t.at(9)},
          {t.at(10), t.at(11), t.at(12), t.at(13)}};
}

TtaSlots::TtaSlots(const AdaptedParameters& initial, std::int64_t capacity) : capacity_(capacity) {
  const at::NoGradGuard no_grad;
  for (const torch::Tensor& shared : to_list(initial)) {
    initial_.push_back(shared.detach());
    AdamState& state = states_.emplace_back();
    state.parameter = room_for(shared.detach().unsqueeze(0), capacity);
    state.first_moment = torch::empty_like(state.parameter);
    state.second_moment = torch::empty_like(state.parameter);
  }
}

void TtaSlots::add(const std::vector<std::int64_t>& instances, const SlotInputs& inputs) {
  const at::NoGradGuard no_grad;
  const auto count = static_cast<std::int64_t>(instances.size());
  TORCH_CHECK(count > 0 && size() + count <= capacity_, "TtaSlots: ", count, " instances for ",
              capacity_ - size(), " free slots");
  SlotInputs given = inputs;
  const std::vector<torch::Tensor*> from = tensors_of(given);
  if (!inputs_.initial_betas.defined()) {
    inputs_.memory.keys_values.resize(inputs.memory.keys_values.size());
    const std::vector<torch::Tensor*> made = tensors_of(inputs_);
    for (std::size_t i = 0; i < made.size(); ++i) *made[i] = room_for(*from[i], capacity_);
  }
  const std::vector<torch::Tensor*> to = tensors_of(inputs_);
  for (std::size_t i = 0; i < to.size(); ++i) to[i]->narrow(0, size(), count).copy_(*from[i]);
  for (std::size_t i = 0; i < states_.size(); ++i) {
    states_[i].parameter.narrow(0, size(), count).copy_(initial_[i]);
    states_[i].first_moment.narrow(0, size(), count).zero_();
    states_[i].second_moment.narrow(0, size(), count).zero_();
  }
  instances_.insert(instances_.end(), instances.begin(), instances.end());
  steps_.resize(instances_.size(), 0);
}

AdaptedParameters TtaSlots::parameters(bool embeddings_require_grad) const {
  std::vector<torch::Tensor> rows;
  for (const AdamState& state : states_) rows.push_back(active(state.parameter).detach());
  AdaptedParameters parameters = from_list(rows);
  parameters.keypoint_2d_embeddings.set_requires_grad(embeddings_require_grad);
  parameters.keypoint_3d_embeddings.set_requires_grad(embeddings_require_grad);
  return parameters;
}

DecoderMemory TtaSlots::memory() const {
  DecoderMemory memory;
  for (const KeysValues& layer : inputs_.memory.keys_values) {
    memory.keys_values.push_back({active(layer.keys), active(layer.values)});
  }
  memory.sampled = active(inputs_.memory.sampled);
  return memory;
}

torch::Tensor TtaSlots::initial_betas() const {
  return active(inputs_.initial_betas);
}

KeypointTargets TtaSlots::targets() const {
  const KeypointTargets& all = inputs_.targets;
  return {active(all.xy), active(all.visible), active(all.held_out), active(all.fitted)};
}

void TtaSlots::step(const std::vector<InstanceGradient>& gradients, double learning_rate) {
  for (std::int64_t& count : steps_) ++count;
  adam_step(states_, gradients, steps_, learning_rate);
}

void TtaSlots::remove(std::int64_t slot) {
  const at::NoGradGuard no_grad;
  const std::int64_t last = size() - 1;
  const auto move_row = [&](const torch::Tensor& rows) {
    if (slot != last) rows.select(0, slot).copy_(rows.select(0, last));
  };
  for (const AdamState& state : states_) {
    for (const auto& rows : {state.parameter, state.first_moment, state.second_moment}) move_row(rows);
  }
  for (const torch::Tensor* rows : tensors_of(inputs_)) move_row(*rows);
  instances_[static_cast<std::size_t>(slot)] = instances_.back();
  instances_.pop_back();
  steps_[static_cast<std::size_t>(slot)] = steps_.back();
  steps_.pop_back();
}

}  // namespace q3d::model
