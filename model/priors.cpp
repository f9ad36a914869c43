#include "model/priors.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <stdexcept>
#include <vector>

#include "model/decoder.h"
#include "smal/sizes.h"

namespace q3d::model {
namespace {

constexpr std::int64_t kPoseNumbers = smal::kNumJoints * 3;

// The official names.
constexpr const char* kMeanPose = "pose_prior_loss.mean_pose";
constexpr const char* kPrecs = "pose_prior_loss.precs";
constexpr const char* kUseIndex = "pose_prior_loss.use_index";
constexpr const char* kMeanBetas = "shape_prior_loss.mean_betas";
constexpr const char* kBetasPrec = "shape_prior_loss.betas_prec";

std::string shape_text(at::IntArrayRef shape) {
  return fmt::format("[{}]", fmt::join(shape, ", "));
}

torch::Tensor read(const smal::tensors::SafeTensors& file, const std::string& name,
                   const std::vector<std::int64_t>& shape, torch::Device device) {
  const torch::Tensor stored = file.tensor(name);
  if (stored.sizes() != at::IntArrayRef(shape)) {
    throw std::runtime_error(fmt::format("{}: {}: shape {}, expected {}", file.path().string(), name,
                                         shape_text(stored.sizes()), shape_text(shape)));
  }
  const torch::Tensor values = stored.to(device, torch::kFloat32, /*non_blocking=*/false, /*copy=*/true);
  if (!values.isfinite().all().item<bool>()) {
    throw std::runtime_error(
        fmt::format("{}: {}: holds numbers that are not finite", file.path().string(), name));
  }
  return values;
}

// Returns (B, families), the squares of the betas whitened by each family's statistics.
torch::Tensor shape_squares(const Priors& priors, const torch::Tensor& betas) {
  const torch::Tensor deviation = betas.unsqueeze(1) - priors.mean_betas;  // (B, families, 41)
  return torch::einsum("bfi,fij->bfj", {deviation, priors.betas_prec}).square().sum(2);
}

}  // namespace

Priors load_priors(const smal::tensors::SafeTensors& file, torch::Device device) {
  const torch::Tensor stored = file.tensor(kMeanBetas);
  const std::int64_t families = stored.dim() == 2 ? stored.size(0) : 0;
  if (families < 1) {
    throw std::runtime_error(fmt::format("{}: {}: shape {}, expected [families, {}]", file.path().string(),
                                         kMeanBetas, shape_text(stored.sizes()), kBetas));
  }
  Priors priors;
  priors.mean_pose = read(file, kMeanPose, {kPoseNumbers}, device);
  priors.precs = read(file, kPrecs, {kPoseNumbers, kPoseNumbers}, device);
  priors.use_index = read(file, kUseIndex, {kPoseNumbers}, device);
  priors.mean_betas = read(file, kMeanBetas, {families, kBetas}, device);
  priors.betas_prec = read(file, kBetasPrec, {families, kBetas, kBetas}, device);
  return priors;
}

void save_priors(const std::filesystem::path& path, const Priors& priors) {
  smal::tensors::write_safetensors(path, {{kMeanPose, priors.mean_pose},
                                          {kPrecs, priors.precs},
                                          {kUseIndex, priors.use_index},
                                          {kBetasPrec, priors.betas_prec},
                                          {kMeanBetas, priors.mean_betas}});
}

torch::Tensor pose_squares(const Priors& priors, const torch::Tensor& pose) {
  return ((pose - priors.mean_pose).matmul(priors.precs) * priors.use_index).square().sum(1);
}

torch::Tensor nearest_shape_squares(const Priors& priors, const torch::Tensor& betas) {
  return std::get<0>(shape_squares(priors, betas).min(1));
}

PartialMean pose_prior(const Priors& priors, const torch::Tensor& pose, const torch::Tensor& has_pose) {
  const torch::Tensor missing = 1.0 - has_pose;
  return {(pose_squares(priors, pose) * missing).sum(), missing.sum() * kPoseNumbers};
}

PartialMean shape_prior(const Priors& priors, const torch::Tensor& betas, const torch::Tensor& family,
                        const torch::Tensor& has_betas) {
  const torch::Tensor missing = 1.0 - has_betas;
  const torch::Tensor distance = shape_squares(priors, betas);
  const torch::Tensor known = distance.gather(1, family.clamp_min(0).unsqueeze(1)).squeeze(1);
  const torch::Tensor nearest = std::get<0>(distance.min(1));
  return {(torch::where(family >= 0, known, nearest) * missing).sum(), missing.sum() * kBetas};
}

}  // namespace q3d::model
