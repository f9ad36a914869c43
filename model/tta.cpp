#include "model/tta.h"

#include <fmt/format.h>
#include <torch/csrc/autograd/autograd.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "model/assemble.h"
#include "model/net.h"
#include "model/tta_slots.h"
#include "smal/tensors/rotation.h"

namespace q3d::model {
namespace {

using filters::adaptation::Schedule;

// A batch of decoder outputs as rows, so that picking iterates is one copy.
torch::Tensor pack(const DecoderOutput& output) {
  return torch::cat({output.pose_6d, output.betas, output.camera, output.aux_keypoints_2d.flatten(1),
                     output.aux_keypoints_3d.flatten(1)},
                    1);
}

DecoderOutput unpack(const torch::Tensor& rows) {
  const auto parts = rows.split_with_sizes({kPose6d, kBetas, kCamera, 2 * kKeypoints, 3 * kKeypoints}, 1);
  return {parts[0], parts[1], parts[2], parts[3].unflatten(1, {kKeypoints, 2}),
          parts[4].unflatten(1, {kKeypoints, 3})};
}

// |prediction - target| averaged over the keypoints of a mask (B, 26, 1) and both coordinates: (B).
torch::Tensor mean_absolute_error(const torch::Tensor& prediction, const KeypointTargets& targets,
                                  const torch::Tensor& mask) {
  const torch::Tensor error = (prediction - targets.xy).abs() * mask;
  return error.sum({1, 2}) / (2.0 * mask.sum({1, 2}).clamp_min(1.0));
}

torch::Tensor objective(const TtaOptions& options, const torch::Tensor& projected, const torch::Tensor& aux,
                        const KeypointTargets& targets) {
  if (options.objective == TtaObjective::demo) {
    const torch::Tensor error = (projected - targets.xy).square() * targets.fitted;
    return error.sum({1, 2}) / (targets.fitted.sum({1, 2}) + 1e-6);
  }
  return options.aux_weight * mean_absolute_error(aux, targets, targets.fitted) +
         options.reproj_weight * mean_absolute_error(projected, targets, targets.fitted);
}

// Per instance (B): the weighted mean squares of the whitened pose and betas.
torch::Tensor prior_terms(const TtaOptions& options, const DecoderOutput& output) {
  torch::Tensor terms = torch::zeros({output.betas.size(0)}, output.betas.options());
  if (options.pose_prior_weight > 0.0) {
    const torch::Tensor pose =
        smal::tensors::matrix_to_axis_angle_smooth(pose_rotations(output.pose_6d)).flatten(1);
    const double mean = options.pose_prior_weight / static_cast<double>(pose.size(1));
    terms = terms + mean * pose_squares(*options.priors, pose);
  }
  if (options.shape_prior_weight > 0.0) {
    const double mean = options.shape_prior_weight / static_cast<double>(kBetas);
    terms = terms + mean * nearest_shape_squares(*options.priors, output.betas);
  }
  return terms;
}

bool uses_priors(const TtaOptions& options) {
  return options.pose_prior_weight > 0.0 || options.shape_prior_weight > 0.0;
}

KeypointTargets make_targets(const torch::Tensor& keypoints, const std::vector<Schedule>& schedules,
                             torch::TensorOptions options) {
  torch::Tensor held_out = torch::zeros({keypoints.size(0), kKeypoints, 1}, options.device(torch::kCPU));
  for (std::size_t i = 0; i < schedules.size(); ++i) {
    for (std::size_t k = 0; k < schedules[i].held_out.size(); ++k) {
      if (!schedules[i].held_out[k]) continue;
      held_out[static_cast<std::int64_t>(i)][static_cast<std::int64_t>(k)].fill_(1.0);
    }
  }
  const torch::Tensor numbers = keypoints.to(options);
  const torch::Tensor visible = numbers.narrow(2, 2, 1) > 0.0;
  KeypointTargets targets;
  targets.xy = torch::where(visible, numbers.narrow(2, 0, 2), torch::zeros({}, numbers.options()));
  targets.visible = visible.to(options);
  targets.held_out = held_out.to(options) * targets.visible;
  targets.fitted = targets.visible - targets.held_out;
  return targets;
}

void require(bool holds, const std::string& message) {
  if (!holds) throw std::invalid_argument("adapt: " + message);
}

void check_held_out(const torch::Tensor& keypoints, const std::vector<Schedule>& schedules) {
  const torch::Tensor weights = keypoints.select(2, 2).to(torch::kCPU, torch::kFloat64).contiguous();
  const auto weight = weights.accessor<double, 2>();
  for (std::size_t i = 0; i < schedules.size(); ++i) {
    const Schedule& schedule = schedules[i];
    if (!filters::adaptation::holds_out(schedule)) continue;
    int fitted = 0;
    for (std::size_t k = 0; k < schedule.held_out.size(); ++k) {
      const bool visible = weight[static_cast<std::int64_t>(i)][static_cast<std::int64_t>(k)] > 0.0;
      require(visible || !schedule.held_out[k],
              fmt::format("instance {}: keypoint {} is held out and not visible", i, k));
      fitted += visible && !schedule.held_out[k] ? 1 : 0;
    }
    require(fitted > 0, fmt::format("instance {}: all visible keypoints are held out", i));
  }
}

void check_arguments(const Prima& prima, const ImageFeatures& features, const torch::Tensor& keypoints,
                     const std::vector<Schedule>& schedules, const TtaOptions& options) {
  require_features(prima.net(), features);
  require(!prima.net().is_training(), "the network is in training mode; call eval() first");
  const std::int64_t batch = features.bio_token.size(0);
  require(batch >= 1, "an empty batch");
  require(keypoints.dim() == 3 && keypoints.size(0) == batch && keypoints.size(1) == kKeypoints &&
              keypoints.size(2) == 3,
          fmt::format("keypoints: expected ({}, {}, 3), got {} dimensions, {} numbers", batch, kKeypoints,
                      keypoints.dim(), keypoints.numel()));
  require(static_cast<std::int64_t>(schedules.size()) == batch,
          fmt::format("{} schedules for {} instances", schedules.size(), batch));
  for (const Schedule& schedule : schedules) filters::adaptation::check(schedule);
  check_held_out(keypoints, schedules);
  require(std::isfinite(options.learning_rate) && options.learning_rate >= 0.0,
          fmt::format("learning rate {}", options.learning_rate));
  for (const double weight : {options.pose_prior_weight, options.shape_prior_weight}) {
    require(std::isfinite(weight) && weight >= 0.0, fmt::format("a prior's weight {}", weight));
  }
  require(!uses_priors(options) || options.priors, "prior terms without priors");
  require(options.slots >= 0, fmt::format("{} slots", options.slots));
  require(std::is_sorted(options.snapshots.begin(), options.snapshots.end()) &&
              (options.snapshots.empty() || options.snapshots.front() >= 0),
          "snapshots must be ascending and 0 or more");
}

// The active instances at one iterate.
struct Iterate {
  torch::Tensor rows;      // (n, 384) packed decoder outputs
  torch::Tensor loss;      // (n), with its graph
  torch::Tensor l_proj;    // (n)
  torch::Tensor held_out;  // (n) error of the held-out keypoints; 0 of an instance without any
  torch::Tensor usable;    // (n) bool: all numbers finite and something visible to measure by
};

class Adaptation {
 public:
  Adaptation(const Prima& prima, const ImageFeatures& features, const torch::Tensor& keypoints,
             const std::vector<Schedule>& schedules, const TtaOptions& options)
      : prima_(prima),
        schedules_(schedules),
        options_(options),
        features_(features),
        total_(static_cast<std::int64_t>(schedules.size())),
        holds_out_(std::any_of(schedules.begin(), schedules.end(), filters::adaptation::holds_out)),
        initial_betas_(decoder().initial_betas(features.bio_token)),
        targets_(make_targets(keypoints, schedules, initial_betas_.options())),
        slots_(decoder().own_parameters(), options.slots > 0 ? std::min(options.slots, total_) : total_) {
    result_.l_proj.resize(schedules.size());
    result_.held_out.resize(schedules.size());
    result_.loss.resize(schedules.size());
    result_.best_iteration.resize(schedules.size(), 0);
  }

  TtaResult run() {
    fill_slots();
    while (slots_.size() > 0) advance();
    const auto assembled = [&](const torch::Tensor& rows) {
      return assemble(prima_.net(), prima_.body(), unpack(rows), initial_betas_, false);
    };
    result_.best = assembled(best_);
    result_.last = assembled(last_);
    for (const torch::Tensor& rows : snapshots_) result_.snapshots.push_back(assembled(rows));
    return std::move(result_);
  }

 private:
  const Decoder& decoder() const { return prima_.net().decoder(); }

  // Instances take the free slots in their order.
  void fill_slots() {
    const std::int64_t count = std::min(slots_.capacity() - slots_.size(), total_ - started_);
    if (count == 0) return;
    const auto part = [&](const torch::Tensor& rows) { return rows.narrow(0, started_, count); };
    std::vector<std::int64_t> instances(static_cast<std::size_t>(count));
    std::iota(instances.begin(), instances.end(), started_);
    slots_.add(instances,
               {decoder().remember(part(features_.image_tokens)),
                part(initial_betas_),
                {part(targets_.xy), part(targets_.visible), part(targets_.held_out), part(targets_.fitted)}});
    started_ += count;
  }

  // Measures the present iterates, steps the instances and replaces those that end here.
  void advance() {
    HeadTapes tapes;
    const bool may_step = any_step_left();
    const AdaptedParameters parameters = slots_.parameters(may_step);
    const Iterate iterate = evaluate(parameters, may_step ? &tapes : nullptr);
    const std::vector<bool> goes_on = record(iterate);
    if (std::find(goes_on.begin(), goes_on.end(), true) != goes_on.end()) {
      slots_.step(gradients(iterate.loss, parameters, tapes), options_.learning_rate);
    }
    const std::int64_t before = slots_.size();
    for (std::int64_t slot = before - 1; slot >= 0; --slot) {
      if (!goes_on[static_cast<std::size_t>(slot)]) slots_.remove(slot);
    }
    finished_ += before - slots_.size();
    if (options_.progress && slots_.size() < before) options_.progress(finished_);
    fill_slots();
  }

  // The gradient of the sum of losses: no operation mixes instances, so each one's stays its own. The tensors
  // are in the order of to_list, and undefined where a leaf has no part in the loss: the embeddings of a
  // network without keypoint tokens.
  static std::vector<InstanceGradient> gradients(const torch::Tensor& loss,
                                                 const AdaptedParameters& parameters,
                                                 const HeadTapes& tapes) {
    std::vector<torch::Tensor> leaves{parameters.keypoint_2d_embeddings, parameters.keypoint_3d_embeddings};
    const std::vector<const MlpTape*> heads{&tapes.pose, &tapes.shape, &tapes.camera};
    for (const MlpTape* head : heads) {
      leaves.insert(leaves.end(), head->hidden_biases.begin(), head->hidden_biases.end());
      leaves.insert(leaves.end(), head->out_biases.begin(), head->out_biases.end());
    }
    const auto found =
        torch::autograd::grad({loss}, leaves, {torch::ones_like(loss)}, /*retain_graph=*/std::nullopt,
                              /*create_graph=*/false, /*allow_unused=*/true);
    std::vector<InstanceGradient> result;
    std::size_t next = 0;
    for (; next < 2; ++next) {
      result.push_back({found[next].defined() ? found[next] : torch::zeros_like(leaves[next]), {}});
    }
    // A matrix, then its bias, whose gradient is the sum over the rounds.
    const auto take = [&](const std::vector<torch::Tensor>& inputs) {
      InstanceGradient matrix, bias;
      for (const torch::Tensor& input : inputs) {
        const torch::Tensor& gradient = found[next++];
        matrix.outer_products.emplace_back(gradient, input);
        bias.dense = bias.dense.defined() ? bias.dense + gradient : gradient;
      }
      result.push_back(std::move(matrix));
      result.push_back(std::move(bias));
    };
    for (const MlpTape* head : heads) {
      take(head->inputs);
      take(head->hidden);
    }
    return result;
  }

  bool any_step_left() const {
    for (std::int64_t slot = 0; slot < slots_.size(); ++slot) {
      if (schedules_[static_cast<std::size_t>(slots_.instance(slot))].iterations > slots_.steps(slot))
        return true;
    }
    return false;
  }

  // Without tapes, no gradients are computed.
  Iterate evaluate(const AdaptedParameters& parameters, HeadTapes* tapes) const {
    const at::AutoGradMode mode(tapes != nullptr);
    const DecoderOutput output =
        decoder().refine(slots_.memory(), slots_.initial_betas(), parameters, /*observe=*/{}, tapes);
    const torch::Tensor projected = projected_keypoints(prima_.body(), output, prima_.config().focal_px);
    const KeypointTargets targets = slots_.targets();
    Iterate iterate;
    iterate.loss = objective(options_, projected, output.aux_keypoints_2d, targets);
    if (uses_priors(options_)) iterate.loss = iterate.loss + prior_terms(options_, output);
    const at::NoGradGuard no_grad;
    iterate.l_proj = mean_absolute_error(projected, targets, targets.visible);
    iterate.held_out = holds_out_ ? mean_absolute_error(projected, targets, targets.held_out)
                                  : torch::zeros_like(iterate.l_proj);
    iterate.rows = pack(output).detach();
    iterate.usable = iterate.rows.isfinite().all(1) & projected.flatten(1).isfinite().all(1) &
                     iterate.loss.isfinite() & iterate.l_proj.isfinite() &
                     (targets.visible.sum({1, 2}) > 0.0);
    return iterate;
  }

  // Stores the iterates in the results. Returns for each slot whether the instance continues.
  std::vector<bool> record(const Iterate& iterate) {
    const torch::Tensor numbers =
        torch::stack({iterate.loss.detach(), iterate.l_proj, iterate.usable.to(iterate.l_proj.scalar_type()),
                      iterate.held_out})
            .to(torch::kCPU, torch::kFloat64);
    const auto rows = numbers.accessor<double, 2>();
    std::vector<std::int64_t> accepted, improved;
    std::vector<bool> goes_on(static_cast<std::size_t>(slots_.size()), false);
    for (std::int64_t slot = 0; slot < slots_.size(); ++slot) {
      const bool is_first = slots_.steps(slot) == 0;
      const bool usable = rows[2][slot] != 0.0;
      // An instance that cannot be measured keeps its prediction.
      if (usable || is_first) accepted.push_back(slot);
      if (is_first) improved.push_back(slot);
      if (!usable) continue;
      const auto instance = static_cast<std::size_t>(slots_.instance(slot));
      result_.loss[instance].push_back(rows[0][slot]);
      result_.l_proj[instance].push_back(rows[1][slot]);
      const bool holds_out = filters::adaptation::holds_out(schedules_[instance]);
      if (holds_out) result_.held_out[instance].push_back(rows[3][slot]);
      const std::vector<double>& judged = holds_out ? result_.held_out[instance] : result_.l_proj[instance];
      int& best = result_.best_iteration[instance];
      if (!is_first && judged.back() < judged[static_cast<std::size_t>(best)]) {
        improved.push_back(slot);
        best = static_cast<int>(slots_.steps(slot));
      }
      goes_on[static_cast<std::size_t>(slot)] =
          !filters::adaptation::is_finished(schedules_[instance], result_.l_proj[instance], best);
    }
    if (!last_.defined()) make_rows(iterate.rows);
    keep(last_, iterate.rows, accepted);
    keep(best_, iterate.rows, improved);
    take_snapshots(goes_on);
    return goes_on;
  }

  void make_rows(const torch::Tensor& like) {
    last_ = torch::empty({total_, like.size(1)}, like.options());
    best_ = torch::empty_like(last_);
    for (std::size_t i = 0; i < options_.snapshots.size(); ++i)
      snapshots_.push_back(torch::empty_like(last_));
  }

  // An instance that ends here shows its last iterate in the later snapshots too.
  void take_snapshots(const std::vector<bool>& goes_on) {
    for (std::size_t i = 0; i < snapshots_.size(); ++i) {
      std::vector<std::int64_t> instances;
      for (std::int64_t slot = 0; slot < slots_.size(); ++slot) {
        const std::int64_t iterate = slots_.steps(slot);
        const bool ends = !goes_on[static_cast<std::size_t>(slot)];
        if (options_.snapshots[i] == iterate || (ends && options_.snapshots[i] > iterate)) {
          instances.push_back(slots_.instance(slot));
        }
      }
      if (instances.empty()) continue;
      const torch::Tensor index = index_of(instances);
      snapshots_[i].index_copy_(0, index, last_.index_select(0, index));
    }
  }

  torch::Tensor index_of(const std::vector<std::int64_t>& values) const {
    return torch::tensor(values, torch::kInt64).to(last_.device());
  }

  void keep(torch::Tensor& kept, const torch::Tensor& rows, const std::vector<std::int64_t>& slots) const {
    if (slots.empty()) return;
    std::vector<std::int64_t> instances;
    for (const std::int64_t slot : slots) instances.push_back(slots_.instance(slot));
    kept.index_copy_(0, index_of(instances), rows.index_select(0, index_of(slots)));
  }

  const Prima& prima_;
  const std::vector<Schedule>& schedules_;
  const TtaOptions& options_;
  const ImageFeatures& features_;
  std::int64_t total_;           // instances
  std::int64_t started_ = 0;     // of them have had a slot
  std::int64_t finished_ = 0;    // of them have left theirs
  bool holds_out_;               // any instance does
  torch::Tensor initial_betas_;  // (total, 41)
  KeypointTargets targets_;      // of all instances
  TtaSlots slots_;
  torch::Tensor best_, last_;             // (total, 384) packed outputs
  std::vector<torch::Tensor> snapshots_;  // likewise, of options_.snapshots
  TtaResult result_;
};

}  // namespace

TtaResult adapt(const Prima& prima, const ImageFeatures& features, const torch::Tensor& keypoints,
                const std::vector<filters::adaptation::Schedule>& schedules, const TtaOptions& options) {
  check_arguments(prima, features, keypoints, schedules, options);
  const at::NoGradGuard no_grad;
  return Adaptation(prima, features, keypoints, schedules, options).run();
}

}  // namespace q3d::model
