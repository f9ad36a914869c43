#include "model/losses.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <stdexcept>
#include <vector>

#include "model/decoder.h"
#include "smal/sizes.h"
#include "smal/tensors/rotation.h"

namespace q3d::model {
namespace {

constexpr std::int64_t kJoints = smal::kNumJoints;
constexpr double kTemperature = 0.1;
constexpr double kBaseTemperature = 0.07;

void check(const char* name, const torch::Tensor& tensor, const std::vector<std::int64_t>& shape,
           torch::ScalarType dtype) {
  if (tensor.defined() && tensor.sizes() == at::IntArrayRef(shape) && tensor.scalar_type() == dtype) return;
  const std::string got = tensor.defined() ? fmt::format("({}) {}", fmt::join(tensor.sizes(), ", "),
                                                         torch::toString(tensor.scalar_type()))
                                           : std::string("nothing");
  throw std::invalid_argument(fmt::format("targets: {}: got {}, expected ({}) {}", name, got,
                                          fmt::join(shape, ", "), torch::toString(dtype)));
}

// Squared errors of the samples whose flag is 1.
torch::Tensor parameter_loss(const torch::Tensor& predicted, const torch::Tensor& target,
                             const torch::Tensor& has) {
  return ((predicted - target).square().flatten(1).sum(1) * has).sum();
}

torch::Tensor axis_angles(const torch::Tensor& rotations, settings::LossVariant variant) {
  return (variant == settings::LossVariant::official ? smal::tensors::matrix_to_axis_angle(rotations)
                                                     : smal::tensors::matrix_to_axis_angle_smooth(rotations))
      .flatten(1);
}

}  // namespace

void check_targets(const Targets& targets) {
  const std::int64_t batch =
      targets.family.defined() && targets.family.dim() == 1 ? targets.family.size(0) : 0;
  check("family", targets.family, {batch}, torch::kInt64);
  check("keypoints_2d", targets.keypoints_2d, {batch, kKeypoints, 3}, torch::kFloat32);
  check("keypoints_3d", targets.keypoints_3d, {batch, kKeypoints, 4}, torch::kFloat32);
  check("rotations", targets.rotations, {batch, kJoints, 3, 3}, torch::kFloat32);
  check("betas", targets.betas, {batch, kBetas}, torch::kFloat32);
  check("has_pose", targets.has_pose, {batch}, torch::kFloat32);
  check("has_betas", targets.has_betas, {batch}, torch::kFloat32);
}

Targets to_device(const Targets& targets, torch::Device device) {
  return {targets.keypoints_2d.to(device), targets.keypoints_3d.to(device), targets.rotations.to(device),
          targets.betas.to(device),        targets.has_pose.to(device),     targets.has_betas.to(device),
          targets.family.to(device)};
}

torch::Tensor keypoint_loss(const torch::Tensor& predicted, const torch::Tensor& target) {
  const std::int64_t axes = predicted.size(2);
  return (target.narrow(2, axes, 1) * (predicted - target.narrow(2, 0, axes)).abs()).sum();
}

torch::Tensor centred_keypoint_loss(const torch::Tensor& predicted, const torch::Tensor& target) {
  const std::int64_t axes = predicted.size(2);
  const torch::Tensor positions = target.narrow(2, 0, axes);
  const torch::Tensor difference =
      (predicted - predicted.narrow(1, 0, 1)) - (positions - positions.narrow(1, 0, 1));
  return (target.narrow(2, axes, 1) * difference.abs()).sum();
}

PartialMean contrastive_loss(const torch::Tensor& features, const torch::Tensor& labels) {
  const torch::Tensor views = torch::cat({features, features});
  const torch::Tensor label = torch::cat({labels, labels});
  const torch::Tensor takes_part = (label >= 0).to(features.scalar_type());
  const torch::Tensor similarity = views.matmul(views.t()) / kTemperature;
  const torch::Tensor logits = similarity - std::get<0>(similarity.max(1, /*keepdim=*/true)).detach();
  const torch::Tensor others = (1.0 - torch::eye(views.size(0), features.options())) * takes_part;
  const torch::Tensor positives = (label.unsqueeze(1) == label).to(features.scalar_type()) * others;
  // An anchor that is left out may have no other sample to compare with; 1 keeps its logarithm finite until
  // it is masked.
  const torch::Tensor denominator = (logits.exp() * others).sum(1, /*keepdim=*/true);
  const torch::Tensor log_share =
      logits - torch::where(denominator > 0, denominator, torch::ones_like(denominator)).log();
  const torch::Tensor mean_log_share = (positives * log_share).sum(1) / positives.sum(1).clamp_min(1.0);
  return {-(kTemperature / kBaseTemperature) * (mean_log_share * takes_part).sum(), takes_part.sum()};
}

LossTerms loss_terms(const Prediction& prediction, const Targets& targets, const Priors& priors,
                     settings::LossVariant variant, const ranks::Collective& ranks) {
  LossTerms terms;
  terms.keypoints_2d = keypoint_loss(prediction.keypoints_2d, targets.keypoints_2d);
  terms.keypoints_3d = centred_keypoint_loss(prediction.keypoints_3d, targets.keypoints_3d);
  terms.aux_keypoints_2d = keypoint_loss(prediction.aux_keypoints_2d, targets.keypoints_2d);
  terms.aux_keypoints_3d = centred_keypoint_loss(prediction.aux_keypoints_3d, targets.keypoints_3d);

  const auto joints = [](const torch::Tensor& rotations) { return rotations.narrow(1, 1, kJoints - 1); };
  terms.global_orient = parameter_loss(prediction.rotations.narrow(1, 0, 1),
                                       targets.rotations.narrow(1, 0, 1), targets.has_pose);
  terms.pose = parameter_loss(joints(prediction.rotations), joints(targets.rotations), targets.has_pose);
  terms.betas = parameter_loss(prediction.betas, targets.betas, targets.has_betas);

  terms.pose_prior = pose_prior(priors, axis_angles(prediction.rotations, variant), targets.has_pose);
  terms.shape_prior = shape_prior(priors, prediction.betas, targets.family, targets.has_betas);
  terms.initial_shape_prior = shape_prior(priors, prediction.init_betas, targets.family, targets.has_betas);
  join_means({&terms.pose_prior, &terms.shape_prior, &terms.initial_shape_prior}, ranks);
  for (torch::Tensor* sum : {&terms.keypoints_2d, &terms.keypoints_3d, &terms.aux_keypoints_2d,
                             &terms.aux_keypoints_3d, &terms.global_orient, &terms.pose, &terms.betas}) {
    if (ranks.size() > 1) *sum = *sum * ranks.size();
  }
  // Every rank computes this loss over the features of all ranks.
  terms.contrastive = contrastive_loss(ranks.gather(prediction.shape_feature), ranks.gather(targets.family));
  return terms;
}

torch::Tensor total_loss(const LossTerms& terms, const settings::LossWeights& weights) {
  return weights.keypoints_3d * terms.keypoints_3d + weights.keypoints_2d * terms.keypoints_2d +
         weights.aux_keypoints_2d * terms.aux_keypoints_2d +
         weights.aux_keypoints_3d * terms.aux_keypoints_3d +
         weights.global_orient * (terms.global_orient + 0.5 * terms.pose_prior.value()) +
         weights.pose * (terms.pose + 0.5 * terms.pose_prior.value()) +
         weights.betas * (terms.betas + terms.shape_prior.value() + 0.5 * terms.initial_shape_prior.value()) +
         weights.contrastive * terms.contrastive.value();
}

}  // namespace q3d::model
