#include "model/tta_slots.h"

#include <ATen/ops/_fused_adam.h>

#include <numeric>
#include <utility>

namespace q3d::model {
namespace {

constexpr double kBeta1 = 0.9;
constexpr double kBeta2 = 0.999;
constexpr double kEpsilon = 1e-8;

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

TtaSlots::TtaSlots(const AdaptedParameters& initial, DecoderMemory memory, torch::Tensor initial_betas,
                   KeypointTargets targets)
    : instances_(static_cast<std::size_t>(initial_betas.size(0))),
      memory_(std::move(memory)),
      initial_betas_(std::move(initial_betas)),
      targets_(std::move(targets)) {
  const at::NoGradGuard no_grad;
  std::iota(instances_.begin(), instances_.end(), std::int64_t{0});
  for (const torch::Tensor& shared : to_list(initial)) {
    std::vector<std::int64_t> repeats(static_cast<std::size_t>(shared.dim()) + 1, 1);
    repeats[0] = size();
    parameters_.push_back(shared.detach().unsqueeze(0).repeat(repeats));
    first_moments_.push_back(torch::zeros_like(parameters_.back()));
    second_moments_.push_back(torch::zeros_like(parameters_.back()));
    step_counts_.push_back(torch::zeros({}, shared.options().dtype(torch::kFloat32).requires_grad(false)));
  }
}

std::vector<torch::Tensor> TtaSlots::parameters(bool requires_grad) const {
  std::vector<torch::Tensor> leaves;
  for (const auto& rows : parameters_)
    leaves.push_back(active(rows).detach().set_requires_grad(requires_grad));
  return leaves;
}

DecoderMemory TtaSlots::memory() const {
  DecoderMemory memory;
  for (const auto& rows : memory_.keys_values) memory.keys_values.push_back(active(rows));
  memory.sampled = active(memory_.sampled);
  return memory;
}

torch::Tensor TtaSlots::initial_betas() const {
  return active(initial_betas_);
}

KeypointTargets TtaSlots::targets() const {
  return {active(targets_.xy), active(targets_.visible), active(targets_.held_out), active(targets_.fitted)};
}

void TtaSlots::step(const std::vector<torch::Tensor>& gradients, double learning_rate) {
  const at::NoGradGuard no_grad;
  std::vector<torch::Tensor> parameters, grads, first, second;
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    parameters.push_back(active(parameters_[i]));
    grads.push_back(gradients.at(i).contiguous());
    first.push_back(active(first_moments_[i]));
    second.push_back(active(second_moments_[i]));
    step_counts_[i].add_(1.0);
  }
  at::_fused_adam_(parameters, grads, first, second, {}, step_counts_, learning_rate, kBeta1, kBeta2,
                   /*weight_decay=*/0.0, kEpsilon, /*amsgrad=*/false, /*maximize=*/false);
}

void TtaSlots::remove(std::int64_t slot) {
  const at::NoGradGuard no_grad;
  const std::int64_t last = size() - 1;
  const auto move_row = [&](const torch::Tensor& rows) {
    if (slot != last) rows.select(0, slot).copy_(rows.select(0, last));
  };
  for (const auto* group : {&parameters_, &first_moments_, &second_moments_, &memory_.keys_values}) {
    for (const auto& rows : *group) move_row(rows);
  }
  for (const auto& rows :
       {memory_.sampled, initial_betas_, targets_.xy, targets_.visible, targets_.held_out, targets_.fitted}) {
    move_row(rows);
  }
  instances_[static_cast<std::size_t>(slot)] = instances_.back();
  instances_.pop_back();
}

}  // namespace q3d::model
