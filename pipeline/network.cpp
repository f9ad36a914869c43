#include "pipeline/network.h"

#include <fmt/format.h>
#include <torch/torch.h>

#include <algorithm>
#include <cmath>
#include <thread>

#include "loaders/crop.h"
#include "model/config.h"
#include "model/device.h"
#include "model/prima.h"
#include "model/priors.h"
#include "model/tta.h"
#include "pipeline/errors.h"
#include "smal/synthetic_quadruped.h"

namespace q3d::pipeline {
namespace {

constexpr std::int64_t kSide = loaders::kPatchSidePx;

template <std::size_t N>
void copy_row(const torch::Tensor& batch, std::int64_t row, std::array<float, N>& into) {
  const torch::Tensor flat = batch[row].flatten();
  TORCH_CHECK(flat.numel() == static_cast<std::int64_t>(N), "prediction row has ", flat.numel(), " numbers");
  std::copy_n(flat.data_ptr<float>(), N, into.begin());
}

torch::Tensor on_host(const torch::Tensor& tensor) {
  return tensor.to(torch::kCPU, torch::kFloat32).contiguous();
}

// Splits a batch into rows; one device-to-host copy a field.
void append_rows(const model::Prediction& batch, std::vector<BodyPrediction>& rows) {
  const torch::Tensor rotations = on_host(batch.rotations);
  const torch::Tensor betas = on_host(batch.betas);
  const torch::Tensor camera = on_host(batch.camera);
  const torch::Tensor translation = on_host(batch.translation);
  const torch::Tensor keypoints_3d = on_host(batch.keypoints_3d);
  const torch::Tensor keypoints_2d = on_host(batch.keypoints_2d);
  const torch::Tensor aux_keypoints_2d = on_host(batch.aux_keypoints_2d);
  for (std::int64_t i = 0; i < rotations.size(0); ++i) {
    BodyPrediction& row = rows.emplace_back();
    copy_row(rotations, i, row.rotations);
    copy_row(betas, i, row.betas);
    copy_row(camera, i, row.camera);
    copy_row(translation, i, row.translation);
    copy_row(keypoints_3d, i, row.keypoints_3d);
    copy_row(keypoints_2d, i, row.keypoints_2d);
    copy_row(aux_keypoints_2d, i, row.aux_keypoints_2d);
  }
}

// (B, 3, 256, 256) uint8 from interleaved rows.
torch::Tensor stack_patches(std::span<const PatchView> patches) {
  torch::Tensor batch =
      torch::empty({static_cast<std::int64_t>(patches.size()), kSide, kSide, 3}, torch::kUInt8);
  std::uint8_t* out = batch.data_ptr<std::uint8_t>();
  for (const PatchView& patch : patches) {
    TORCH_CHECK(patch.size() == static_cast<std::size_t>(kSide * kSide * 3), "patch has ", patch.size(),
                " bytes");
    out = std::copy(patch.begin(), patch.end(), out);
  }
  return batch.permute({0, 3, 1, 2}).contiguous();
}

template <typename T>
bool all_finite(const T& values) {
  return std::all_of(values.begin(), values.end(), [](float value) { return std::isfinite(value); });
}

model::DeviceChoice choose_device(const std::string& name) {
  try {
    return model::choose_device(name);
  } catch (const std::invalid_argument& error) {
    throw ConfigError(error.what());
  }
}

int resolved_threads(int wanted) {
  return wanted > 0 ? wanted : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

model::TtaOptions tta_options(const TtaConfig& tta) {
  model::TtaOptions options;
  options.objective = tta.objective == "demo" ? model::TtaObjective::demo : model::TtaObjective::paper;
  options.learning_rate = tta.learning_rate;
  options.aux_weight = tta.aux_weight;
  options.reproj_weight = tta.reproj_weight;
  return options;
}

model::TtaSchedule schedule_of(const AdaptRequest& request) {
  model::TtaSchedule schedule;
  schedule.iterations = request.iterations;
  schedule.stop_below = request.stop_below;
  schedule.min_gain = request.min_gain;
  schedule.gain_window = request.gain_window;
  schedule.patience = request.patience;
  for (std::size_t k = 0; k < request.held_out.size(); ++k) schedule.held_out[k] = request.held_out[k];
  return schedule;
}

}  // namespace

bool is_finite(const BodyPrediction& body) {
  return all_finite(body.rotations) && all_finite(body.betas) && all_finite(body.camera) &&
         all_finite(body.translation) && all_finite(body.keypoints_3d) && all_finite(body.keypoints_2d) &&
         all_finite(body.aux_keypoints_2d);
}

struct Network::Impl {
  Impl(const NetworkConfig& network, const TtaConfig& tta)
      : threads(resolved_threads(network.compute_threads)),
        predict_batch(static_cast<std::size_t>(network.batch)),
        adapt_batch(static_cast<std::size_t>(tta.batch)),
        options(tta_options(tta)),
        device(choose_device(network.device)),
        prima(model::Prima::load(network.checkpoint, network.smal_asset, device.device,
                                 network.dtype == "bfloat16" ? torch::kBFloat16 : torch::kFloat32)) {}

  // OpenMP's thread count belongs to the calling thread, so it is set wherever work begins.
  void begin() const { model::configure_compute(threads); }

  int threads;
  std::size_t predict_batch;
  std::size_t adapt_batch;
  model::TtaOptions options;
  model::DeviceChoice device;
  model::Prima prima;
};

Network::Network(const NetworkConfig& network, const TtaConfig& tta)
    : impl_(std::make_unique<Impl>(network, tta)) {}
Network::~Network() = default;

const std::string& Network::device_description() const {
  return impl_->device.description;
}
const std::string& Network::device_warning() const {
  return impl_->device.warning;
}

std::string device_key(const NetworkConfig& network) {
  const bool on_cpu = choose_device(network.device).device.is_cpu();
  return on_cpu ? fmt::format("cpu-{}", resolved_threads(network.compute_threads)) : "cuda";
}

std::vector<BodyPrediction> Network::predict(std::span<const PatchView> patches) {
  impl_->begin();
  const torch::InferenceMode no_gradients;
  std::vector<BodyPrediction> rows;
  rows.reserve(patches.size());
  for (std::size_t first = 0; first < patches.size(); first += impl_->predict_batch) {
    const auto batch = patches.subspan(first, std::min(impl_->predict_batch, patches.size() - first));
    const model::Prima& prima = impl_->prima;
    append_rows(prima.predict(prima.encode(prima.normalise(stack_patches(batch)))), rows);
  }
  return rows;
}

std::vector<AdaptOutcome> Network::adapt(std::span<const AdaptRequest> requests,
                                         const std::vector<int>& snapshots) {
  impl_->begin();
  model::TtaOptions options = impl_->options;
  options.snapshots = snapshots;
  std::vector<AdaptOutcome> outcomes;
  outcomes.reserve(requests.size());
  for (std::size_t first = 0; first < requests.size(); first += impl_->adapt_batch) {
    const auto batch = requests.subspan(first, std::min(impl_->adapt_batch, requests.size() - first));
    std::vector<PatchView> patches;
    std::vector<model::TtaSchedule> schedules;
    torch::Tensor keypoints =
        torch::empty({static_cast<std::int64_t>(batch.size()), manifests::kNumKeypoints, 3}, torch::kFloat32);
    float* out = keypoints.data_ptr<float>();
    for (const AdaptRequest& request : batch) {
      patches.push_back(request.patch);
      schedules.push_back(schedule_of(request));
      out = std::copy(request.keypoints.begin(), request.keypoints.end(), out);
    }
    const model::Prima& prima = impl_->prima;
    const model::ImageFeatures features = [&] {
      const torch::NoGradGuard no_gradients;
      return prima.encode(prima.normalise(stack_patches(patches)));
    }();
    const model::TtaResult result = model::adapt(prima, features, keypoints, schedules, options);
    std::vector<BodyPrediction> rows;
    append_rows(result.best, rows);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      outcomes.push_back({rows[i], result.l_proj[i], result.held_out[i], result.best_iteration[i], {}});
    }
    for (const model::Prediction& snapshot : result.snapshots) {
      std::vector<BodyPrediction> iterates;
      append_rows(snapshot, iterates);
      for (std::size_t i = 0; i < iterates.size(); ++i) {
        outcomes[first + i].snapshots.push_back(iterates[i]);
      }
    }
  }
  return outcomes;
}

void write_initial_checkpoint(const std::filesystem::path& path, const std::string& size,
                              std::uint64_t seed) {
  model::PrimaConfig config;
  try {
    config = model::named_config(size);
  } catch (const std::invalid_argument& error) {
    throw ConfigError(error.what());
  }
  model::write_initial_checkpoint(path, config, seed);
}

void write_synthetic_asset(const std::filesystem::path& path) {
  smal::save_asset(path, smal::make_synthetic_quadruped());
}

void write_synthetic_priors(const std::filesystem::path& path) {
  model::save_priors(path, model::synthetic_priors());
}

}  // namespace q3d::pipeline
