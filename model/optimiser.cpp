#include "model/optimiser.h"

#include <algorithm>
#include <functional>
#include <string_view>

#include "model/efficientnet_lite.h"
#include "model/module_state.h"
#include "model/net.h"

namespace q3d::model {
namespace {

bool is_backbone(std::string_view name) {
  return name.starts_with("backbone.");
}

bool is_bio_encoder(std::string_view name) {
  return name.starts_with("bioclip_embedding.species_model.");
}

bool is_in_efficientnet(std::string_view name) {
  return !name_in_efficientnet(name).empty();
}

// Says which parameters a group holds, and how fast it learns.
struct Share {
  std::function<bool(std::string_view name)> holds;
  double rate_scale;
};

// The parameters by the first share that holds them. Gradients are switched on for these and off for all
// others. Groups without a parameter are left out, but for the first `always`.
std::vector<ParameterGroup> split(PrimaNet& net, const std::vector<Share>& shares, std::size_t always) {
  std::vector<ParameterGroup> groups;
  for (const Share& share : shares) groups.push_back({{}, share.rate_scale});
  for (auto& parameter : net.named_parameters()) {
    const auto share = std::find_if(shares.begin(), shares.end(),
                                    [&](const Share& candidate) { return candidate.holds(parameter.key()); });
    parameter.value().set_requires_grad(share != shares.end());
    if (share == shares.end()) continue;
    groups[static_cast<std::size_t>(share - shares.begin())].parameters.emplace_back(parameter.key(),
                                                                                     parameter.value());
  }
  while (groups.size() > always && groups.back().parameters.empty()) groups.pop_back();
  return groups;
}

}  // namespace

AdamW::AdamW(std::vector<ParameterGroup> groups, const AdamWOptions& options) : options_(options) {
  for (ParameterGroup& group : groups) {
    Group& kept = groups_.emplace_back();
    kept.rate_scale = group.rate_scale;
    for (auto& [name, parameter] : group.parameters) {
      kept.slots.push_back({name, parameter, torch::zeros_like(parameter), torch::zeros_like(parameter),
                            torch::zeros({}, parameter.options().dtype(torch::kFloat32))});
    }
  }
}

std::vector<torch::Tensor> AdamW::parameters() const {
  std::vector<torch::Tensor> all;
  for (const Group& group : groups_) {
    for (const Slot& slot : group.slots) all.push_back(slot.parameter);
  }
  return all;
}

void AdamW::zero_grad() {
  for (Group& group : groups_) {
    for (Slot& slot : group.slots) slot.parameter.mutable_grad().reset();
  }
}

void AdamW::step(double learning_rate) {
  const at::NoGradGuard no_grad;
  for (Group& group : groups_) {
    std::vector<torch::Tensor> parameters, gradients, first, second, steps;
    for (Slot& slot : group.slots) {
      if (!slot.parameter.grad().defined()) continue;
      parameters.push_back(slot.parameter);
      gradients.push_back(slot.parameter.grad());
      first.push_back(slot.first_moment);
      second.push_back(slot.second_moment);
      steps.push_back(slot.steps);
    }
    if (parameters.empty()) continue;
    at::_foreach_add_(steps, 1.0);  // the fused kernel reads the counts and leaves them
    at::_fused_adamw_(parameters, gradients, first, second, /*max_exp_avg_sqs=*/{}, steps,
                      learning_rate * group.rate_scale, options_.beta1, options_.beta2, options_.weight_decay,
                      options_.epsilon, /*amsgrad=*/false, /*maximize=*/false);
  }
}

std::vector<torch::Tensor> AdamW::gradients() const {
  std::vector<torch::Tensor> all;
  for (const Group& group : groups_) {
    for (const Slot& slot : group.slots) {
      if (slot.parameter.grad().defined()) all.push_back(slot.parameter.grad());
    }
  }
  return all;
}

torch::Tensor AdamW::gradient_norm() const {
  const at::NoGradGuard no_grad;
  const std::vector<torch::Tensor> all = gradients();
  if (all.empty()) return torch::zeros({});
  return torch::stack(at::_foreach_norm(all)).norm();
}

void AdamW::clip(const torch::Tensor& norm, double largest) {
  const at::NoGradGuard no_grad;
  const torch::Tensor scale = (largest / (norm + 1e-6)).clamp_max(1.0);
  for (torch::Tensor& gradient : gradients()) gradient.mul_(scale);
}

void AdamW::append_state(smal::tensors::NamedTensors& state, const std::string& prefix) const {
  const auto append = [&](const std::string& name, const torch::Tensor& tensor) {
    state.emplace_back(prefix + name, tensor.to(torch::kCPU, /*non_blocking=*/false, /*copy=*/true));
  };
  for (const Group& group : groups_) {
    for (const Slot& slot : group.slots) {
      append(slot.name + ".exp_avg", slot.first_moment);
      append(slot.name + ".exp_avg_sq", slot.second_moment);
      append(slot.name + ".step", slot.steps);
    }
  }
}

void AdamW::restore_state(const smal::tensors::SafeTensors& file, const std::string& prefix) {
  for (Group& group : groups_) {
    for (Slot& slot : group.slots) {
      slot.first_moment = restored_like(file, prefix + slot.name + ".exp_avg", slot.first_moment);
      slot.second_moment = restored_like(file, prefix + slot.name + ".exp_avg_sq", slot.second_moment);
      slot.steps = restored_like(file, prefix + slot.name + ".step", slot.steps);
    }
  }
}

std::vector<ParameterGroup> parameter_groups(PrimaNet& net, double backbone_rate_scale,
                                             const StemTraining& stem) {
  const bool bio_learns = net.config().learn_bio_encoder;
  const auto trains = [bio_learns, frozen = stem.frozen_blocks](std::string_view name) {
    return (bio_learns || !is_bio_encoder(name)) && !is_in_first_blocks(name, frozen);
  };
  const auto in_stem = [trains](std::string_view name) { return trains(name) && is_in_efficientnet(name); };
  return split(
      net,
      {{[=](std::string_view name) { return trains(name) && is_backbone(name) && !in_stem(name); },
        backbone_rate_scale},
       {[=](std::string_view name) { return trains(name) && !is_backbone(name) && !in_stem(name); }, 1.0},
       {[=](std::string_view name) { return is_backbone(name) && in_stem(name); },
        backbone_rate_scale * stem.rate_scale},
       {[=](std::string_view name) { return !is_backbone(name) && in_stem(name); }, stem.rate_scale}},
      /*always=*/2);
}

std::vector<ParameterGroup> encoder_groups(PrimaNet& net, const StemTraining& stem) {
  const auto trains = [frozen = stem.frozen_blocks](std::string_view name) {
    return (is_backbone(name) || is_bio_encoder(name)) && !is_in_first_blocks(name, frozen);
  };
  return split(
      net,
      {{[=](std::string_view name) { return trains(name) && !is_in_efficientnet(name); }, 1.0},
       {[=](std::string_view name) { return trains(name) && is_in_efficientnet(name); }, stem.rate_scale}},
      /*always=*/1);
}

double rate_at(const RateSchedule& schedule, std::int64_t step) {
  if (step < schedule.warm_up_steps) {
    return schedule.learning_rate * static_cast<double>(step + 1) /
           static_cast<double>(schedule.warm_up_steps);
  }
  if (schedule.decay_end_step <= schedule.warm_up_steps) return schedule.learning_rate;
  const double left = static_cast<double>(schedule.decay_end_step - step) /
                      static_cast<double>(schedule.decay_end_step - schedule.warm_up_steps);
  return schedule.learning_rate * std::max(0.0, left);
}

}  // namespace q3d::model
