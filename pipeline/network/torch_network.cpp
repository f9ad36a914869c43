#include "pipeline/network/torch_network.h"

#include <fmt/format.h>
#include <torch/types.h>

#include <algorithm>
#include <cmath>
#include <thread>

#include "loaders/pictures/crop.h"
#include "model/config.h"
#include "model/device.h"
#include "model/prima.h"
#include "model/priors.h"
#include "model/tta.h"
#include "pipeline/run/errors.h"
#include "smal/numbers.h"
#include "smal/tensors/safetensors.h"

namespace q3d::pipeline::network {
namespace {

constexpr std::int64_t kSide = loaders::pictures::kPatchSidePx;

template <typename Value>
void copy_row(const torch::Tensor& batch, std::int64_t row, Value& into) {
  smal::NumbersOf<Value> numbers;
  const torch::Tensor flat = batch[row].flatten();
  TORCH_CHECK(flat.numel() == static_cast<std::int64_t>(numbers.size()), "prediction row has ", flat.numel(),
              " numbers");
  std::copy_n(flat.data_ptr<float>(), numbers.size(), numbers.begin());
  into = smal::from_numbers<Value>(numbers);
}

torch::Tensor on_host(const torch::Tensor& tensor) {
  return tensor.to(torch::kCPU, torch::kFloat32).contiguous();
}

// Splits a batch into rows; one device-to-host copy a field.
void append_rows(const model::Prediction& batch, std::vector<device::BodyPrediction>& rows) {
  const torch::Tensor rotations = on_host(batch.rotations);
  const torch::Tensor betas = on_host(batch.betas);
  const torch::Tensor camera = on_host(batch.camera);
  const torch::Tensor translation = on_host(batch.translation);
  const torch::Tensor keypoints_3d = on_host(batch.keypoints_3d);
  const torch::Tensor keypoints_2d = on_host(batch.keypoints_2d);
  const torch::Tensor aux_keypoints_2d = on_host(batch.aux_keypoints_2d);
  const torch::Tensor aux_keypoints_3d = on_host(batch.aux_keypoints_3d);
  for (std::int64_t i = 0; i < rotations.size(0); ++i) {
    device::BodyPrediction& row = rows.emplace_back();
    copy_row(rotations, i, row.pose);
    copy_row(betas, i, row.betas);
    copy_row(camera, i, row.camera);
    copy_row(translation, i, row.translation);
    copy_row(keypoints_3d, i, row.keypoints_3d);
    copy_row(keypoints_2d, i, row.keypoints_2d);
    copy_row(aux_keypoints_2d, i, row.aux_keypoints_2d);
    copy_row(aux_keypoints_3d, i, row.aux_keypoints_3d);
  }
}

// (B, 3, 256, 256) uint8 from interleaved rows.
torch::Tensor stack_patches(std::span<const device::PatchView> patches) {
  torch::Tensor batch =
      torch::empty({static_cast<std::int64_t>(patches.size()), kSide, kSide, 3}, torch::kUInt8);
  std::uint8_t* out = batch.data_ptr<std::uint8_t>();
  for (const device::PatchView& patch : patches) {
    TORCH_CHECK(patch.size() == static_cast<std::size_t>(kSide * kSide * 3), "patch has ", patch.size(),
                " bytes");
    out = std::copy(patch.begin(), patch.end(), out);
  }
  return batch.permute({0, 3, 1, 2}).contiguous();
}

// The description of the device counts the threads, so they are set first.
model::DeviceChoice choose_device(const config::NetworkConfig& network, int threads) {
  model::configure_compute(threads);
  try {
    return model::choose_device(network.device, network.local_rank);
  } catch (const std::invalid_argument& error) {
    throw run::ConfigError(error.what());
  }
}

model::TtaOptions tta_options(const config::TtaConfig& tta) {
  model::TtaOptions options;
  options.objective =
      tta.objective == config::TtaObjective::demo ? model::TtaObjective::demo : model::TtaObjective::paper;
  options.learning_rate = tta.learning_rate;
  options.aux_weight = tta.aux_weight;
  options.reproj_weight = tta.reproj_weight;
  options.pose_prior_weight = tta.pose_prior_weight;
  options.shape_prior_weight = tta.shape_prior_weight;
  return options;
}

model::Priors load_needed_priors(const std::filesystem::path& file, torch::Device device) {
  try {
    return model::load_priors(smal::tensors::SafeTensors::open(file), device);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(
        fmt::format("{}\nThe terms tta.pose_prior_weight and tta.shape_prior_weight need the pose and shape "
                    "priors: give their file as guards.priors",
                    error.what()));
  }
}

class TorchNetwork : public device::Network {
 public:
  TorchNetwork(const config::NetworkConfig& network, const config::TtaConfig& tta,
               const std::filesystem::path& priors)
      : threads_(compute_threads(network)),
        predict_batch_(static_cast<std::size_t>(network.batch)),
        adapt_batch_(static_cast<std::size_t>(tta.batch)),
        options_(tta_options(tta)),
        device_(choose_device(network, threads_)),
        prima_(model::Prima::load(
            network.checkpoint, network.smal_asset, device_.device,
            network.dtype == config::Dtype::bfloat16 ? torch::kBFloat16 : torch::kFloat32)) {
    if (config::uses_priors(tta)) options_.priors = load_needed_priors(priors, device_.device);
  }

  std::vector<device::BodyPrediction> predict(std::span<const device::PatchView> patches) override;
  std::vector<device::AdaptOutcome> adapt(std::span<const device::AdaptRequest> requests,
                                          const std::vector<int>& snapshots) override;
  const std::string& device_description() const override { return device_.description; }
  const std::string& device_warning() const override { return device_.warning; }

 private:
  // OpenMP's thread count belongs to the calling thread, so it is set wherever work begins.
  void begin() const { model::configure_compute(threads_); }

  int threads_;
  std::size_t predict_batch_;
  std::size_t adapt_batch_;
  model::TtaOptions options_;
  model::DeviceChoice device_;
  model::Prima prima_;
};

std::vector<device::BodyPrediction> TorchNetwork::predict(std::span<const device::PatchView> patches) {
  begin();
  const c10::InferenceMode no_gradients;
  std::vector<device::BodyPrediction> rows;
  rows.reserve(patches.size());
  for (std::size_t first = 0; first < patches.size(); first += predict_batch_) {
    const auto batch = patches.subspan(first, std::min(predict_batch_, patches.size() - first));
    append_rows(prima_.predict(prima_.encode(prima_.normalise(stack_patches(batch)))), rows);
  }
  return rows;
}

std::vector<device::AdaptOutcome> TorchNetwork::adapt(std::span<const device::AdaptRequest> requests,
                                                      const std::vector<int>& snapshots) {
  begin();
  model::TtaOptions options = options_;
  options.snapshots = snapshots;
  std::vector<device::AdaptOutcome> outcomes;
  outcomes.reserve(requests.size());
  for (std::size_t first = 0; first < requests.size(); first += adapt_batch_) {
    const auto batch = requests.subspan(first, std::min(adapt_batch_, requests.size() - first));
    std::vector<device::PatchView> patches;
    std::vector<filters::adaptation::Schedule> schedules;
    torch::Tensor keypoints =
        torch::empty({static_cast<std::int64_t>(batch.size()), smal::kNumKeypoints, 3}, torch::kFloat32);
    float* out = keypoints.data_ptr<float>();
    for (const device::AdaptRequest& request : batch) {
      patches.push_back(request.patch);
      schedules.push_back(request.schedule);
      const auto numbers = smal::numbers_of(request.keypoints);
      out = std::copy(numbers.begin(), numbers.end(), out);
    }
    const model::ImageFeatures features = [&] {
      const at::NoGradGuard no_gradients;
      return prima_.encode(prima_.normalise(stack_patches(patches)));
    }();
    const model::TtaResult result = model::adapt(prima_, features, keypoints, schedules, options);
    std::vector<device::BodyPrediction> rows;
    append_rows(result.best, rows);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      outcomes.push_back({rows[i], result.l_proj[i], result.held_out[i], result.best_iteration[i], {}});
    }
    for (const model::Prediction& snapshot : result.snapshots) {
      std::vector<device::BodyPrediction> iterates;
      append_rows(snapshot, iterates);
      for (std::size_t i = 0; i < iterates.size(); ++i) {
        outcomes[first + i].snapshots.push_back(iterates[i]);
      }
    }
  }
  return outcomes;
}

}  // namespace

std::unique_ptr<device::Network> load_network(const config::NetworkConfig& network,
                                              const config::TtaConfig& tta,
                                              const std::filesystem::path& priors) {
  return std::make_unique<TorchNetwork>(network, tta, priors);
}

int compute_threads(const config::NetworkConfig& network) {
  if (network.compute_threads > 0) return network.compute_threads;
  if (std::filesystem::file_size(network.checkpoint) < kSmallCheckpointBytes) return 1;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

std::string device_key(const config::NetworkConfig& network) {
  const model::DeviceChoice choice = choose_device(network, compute_threads(network));
  const std::string kind =
      choice.device.is_cpu() ? fmt::format("cpu-{}", compute_threads(network)) : std::string("cuda");
  return kind + ", " + model::arithmetic_of(choice);
}

device::NetworkDomain read_domain(const std::filesystem::path& checkpoint) {
  const smal::tensors::SafeTensors file = smal::tensors::SafeTensors::open(checkpoint);
  const auto entry = file.metadata().find(device::kDomainKey);
  if (entry == file.metadata().end()) return {};
  try {
    return device::domain_from_json(entry->second);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: metadata {}", checkpoint.string(), error.what()));
  }
}

void write_initial_checkpoint(const std::filesystem::path& path, const std::string& size, std::uint64_t seed,
                              const std::filesystem::path& stem) {
  try {
    model::write_initial_checkpoint(path, model::named_config(size), seed, torch::kFloat32, stem);
  } catch (const std::invalid_argument& error) {
    throw run::ConfigError(error.what());
  }
}

}  // namespace q3d::pipeline::network
