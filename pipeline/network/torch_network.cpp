#include "pipeline/network/torch_network.h"

#include <fmt/format.h>
#include <torch/types.h>

#include <algorithm>
#include <cmath>
#include <thread>
#include <utility>

#include "loaders/pictures/crop.h"
#include "model/config.h"
#include "model/device.h"
#include "model/prima.h"
#include "model/priors.h"
#include "model/tta.h"
#include "pipeline/config/device_names.h"
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

// Splits a batch into rows, with one device-to-host copy for each field.
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

// Returns (B, 3, 256, 256) uint8 from interleaved rows.
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

// Chooses the device. Its description contains the number of threads, so that is set first.
model::DeviceChoice choose_device(const config::NetworkConfig& network, int threads) {
  model::configure_compute(threads);
  try {
    return model::choose_device(config::device_of_rank(network.device, network.local_rank),
                                network.local_rank);
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

struct TorchFeatures : device::PictureFeatures {
  explicit TorchFeatures(model::ImageFeatures of) : features(std::move(of)) {}
  model::ImageFeatures features;  // a batch of one
};

model::ImageFeatures row_of(const model::ImageFeatures& batch, std::int64_t i) {
  return {batch.image_tokens.narrow(0, i, 1), batch.bio_token.narrow(0, i, 1)};
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

  std::vector<device::BodyPrediction> predict(std::span<const device::PatchView> patches,
                                              std::vector<device::KeptFeatures>* features) override;
  std::vector<device::AdaptOutcome> adapt(std::span<const device::AdaptRequest> requests,
                                          const std::vector<int>& snapshots,
                                          const std::function<void(std::size_t)>& progress) override;
  const std::string& device_description() const override { return device_.description; }
  const std::string& device_warning() const override { return device_.warning; }

 private:
  // OpenMP's thread count belongs to the calling thread, so it is set wherever work begins.
  void begin() const { model::configure_compute(threads_); }
  // Returns whether pictures are encoded one by one, as on a CPU. With packed matrices this is as fast as a
  // batch, and a picture's features then do not depend on other pictures.
  bool encodes_singly() const { return prima_.device().is_cpu(); }
  model::ImageFeatures encode(std::span<const device::PatchView> patches) const;
  model::ImageFeatures features_of(std::span<const device::AdaptRequest> requests) const;

  int threads_;
  std::size_t predict_batch_;
  std::size_t adapt_batch_;
  model::TtaOptions options_;
  model::DeviceChoice device_;
  model::Prima prima_;
};

model::ImageFeatures TorchNetwork::encode(std::span<const device::PatchView> patches) const {
  const std::size_t step = encodes_singly() ? 1 : predict_batch_;
  std::vector<torch::Tensor> image_tokens, bio_tokens;
  for (std::size_t first = 0; first < patches.size(); first += step) {
    const auto batch = patches.subspan(first, std::min(step, patches.size() - first));
    const model::ImageFeatures some = prima_.encode(prima_.normalise(stack_patches(batch)));
    image_tokens.push_back(some.image_tokens);
    bio_tokens.push_back(some.bio_token);
  }
  return {torch::cat(image_tokens), torch::cat(bio_tokens)};
}

std::vector<device::BodyPrediction> TorchNetwork::predict(std::span<const device::PatchView> patches,
                                                          std::vector<device::KeptFeatures>* features) {
  begin();
  const at::NoGradGuard no_gradients;
  std::vector<device::BodyPrediction> rows;
  rows.reserve(patches.size());
  for (std::size_t first = 0; first < patches.size(); first += predict_batch_) {
    const auto batch = patches.subspan(first, std::min(predict_batch_, patches.size() - first));
    const model::ImageFeatures found = encode(batch);
    append_rows(prima_.predict(found), rows);
    if (features == nullptr) continue;
    for (std::int64_t i = 0; i < found.bio_token.size(0); ++i) {
      features->push_back(encodes_singly() ? std::make_shared<TorchFeatures>(row_of(found, i)) : nullptr);
    }
  }
  return rows;
}

// Encodes the pictures whose features are not given.
model::ImageFeatures TorchNetwork::features_of(std::span<const device::AdaptRequest> requests) const {
  const at::NoGradGuard no_gradients;
  std::vector<device::PatchView> patches;
  for (const device::AdaptRequest& request : requests) {
    if (!request.features) patches.push_back(request.patch);
  }
  model::ImageFeatures encoded;
  if (!patches.empty()) encoded = encode(patches);
  if (patches.size() == requests.size()) return encoded;
  std::vector<torch::Tensor> image_tokens, bio_tokens;
  std::int64_t next = 0;
  for (const device::AdaptRequest& request : requests) {
    const model::ImageFeatures one = request.features
                                         ? dynamic_cast<const TorchFeatures&>(*request.features).features
                                         : row_of(encoded, next++);
    image_tokens.push_back(one.image_tokens);
    bio_tokens.push_back(one.bio_token);
  }
  return {torch::cat(image_tokens), torch::cat(bio_tokens)};
}

std::vector<device::AdaptOutcome> TorchNetwork::adapt(std::span<const device::AdaptRequest> requests,
                                                      const std::vector<int>& snapshots,
                                                      const std::function<void(std::size_t)>& progress) {
  if (requests.empty()) return {};
  begin();
  model::TtaOptions options = options_;
  options.snapshots = snapshots;
  options.slots = static_cast<std::int64_t>(adapt_batch_);
  if (progress) {
    options.progress = [&](std::int64_t ended) { progress(static_cast<std::size_t>(ended)); };
  }
  std::vector<filters::adaptation::Schedule> schedules;
  torch::Tensor keypoints =
      torch::empty({static_cast<std::int64_t>(requests.size()), smal::kNumKeypoints, 3}, torch::kFloat32);
  float* out = keypoints.data_ptr<float>();
  for (const device::AdaptRequest& request : requests) {
    schedules.push_back(request.schedule);
    const auto numbers = smal::numbers_of(request.keypoints);
    out = std::copy(numbers.begin(), numbers.end(), out);
  }
  const model::TtaResult result = model::adapt(prima_, features_of(requests), keypoints, schedules, options);
  std::vector<device::BodyPrediction> rows;
  append_rows(result.best, rows);
  std::vector<device::AdaptOutcome> outcomes;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    outcomes.push_back({rows[i], result.l_proj[i], result.held_out[i], result.best_iteration[i], {}});
  }
  for (const model::Prediction& snapshot : result.snapshots) {
    std::vector<device::BodyPrediction> iterates;
    append_rows(snapshot, iterates);
    for (std::size_t i = 0; i < iterates.size(); ++i) outcomes[i].snapshots.push_back(iterates[i]);
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
