// One rank of a training, for ranks_test: `rank_steps MODE OUT`. Trains three steps on its part of a seeded
// batch of six and writes what came out to OUT.<rank>. Which rank it is says the environment, as for the
// program; with nothing said there it trains on the whole batch.
//
//   exact    the network's losses and AdamW in float64
//   prima    Trainer in float32, with the discriminator
//   encoders EncoderTrainer in float32
//   prima_stem, encoders_stem
//            the same with a pre-trained stem, of which two blocks are frozen
//   naive_*  the same, but each rank divides by its own counts and knows its own features alone
//   leave    rank 1 ends before the first step
//   wait     meets nobody, for two seconds

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <functional>
#include <string_view>

#include "model/assemble.h"
#include "model/checkpoint.h"
#include "model/device.h"
#include "model/encoder_trainer.h"
#include "model/losses.h"
#include "model/module_state.h"
#include "model/ranks/process_group.h"
#include "model/ranks/rank_place.h"
#include "model/trainer.h"
#include "smal/tensors/camera.h"
#include "smal/tensors/rotation.h"
#include "tests/model/parity_net.h"
#include "tests/support/parity_smal.h"
#include "tests/support/paths.h"

namespace q3d::model::ranks {
namespace {

constexpr std::int64_t kBatch = 6;
constexpr int kSteps = 3;
constexpr double kRate = 1e-3;
constexpr std::int64_t kSpecies = 3;

void for_each(TrainingBatch& batch, const std::function<void(torch::Tensor&)>& change) {
  Targets& targets = batch.targets;
  for (torch::Tensor* tensor :
       {&batch.images, &batch.species, &targets.keypoints_2d, &targets.keypoints_3d, &targets.rotations,
        &targets.betas, &targets.has_pose, &targets.has_betas, &targets.family}) {
    change(*tensor);
  }
}

// Two ranks get 1 and 2 samples without pose, 2 and 3 without betas; each family has samples on both, and
// the second rank has more labelled keypoints and fewer known species.
TrainingBatch joint_batch(const smal::tensors::SmalBody& body) {
  at::manual_seed(11);
  TrainingBatch batch;
  batch.images = torch::randn({kBatch, 3, 256, 256});
  Targets& targets = batch.targets;
  targets.rotations = smal::tensors::axis_angle_to_matrix_exact(0.3 * torch::randn({kBatch, 35, 3}));
  targets.betas = 0.2 * torch::randn({kBatch, kBetas});
  const torch::Tensor keypoints = body.keypoints(targets.rotations, targets.betas);
  const torch::Tensor translation = torch::tensor({0.0F, 0.0F, 9.0F}).expand({kBatch, 3});
  torch::Tensor seen = torch::ones({kBatch, 26, 1});
  seen.narrow(0, 0, 2).narrow(1, 5, 15).zero_();
  targets.keypoints_3d = torch::cat({keypoints, seen}, 2);
  targets.keypoints_2d = torch::cat({smal::tensors::project_to_crop(keypoints, translation), seen}, 2);
  targets.has_pose = torch::tensor({1.0F, 0.0F, 1.0F, 0.0F, 1.0F, 0.0F});
  targets.has_betas = torch::tensor({0.0F, 0.0F, 1.0F, 0.0F, 0.0F, 0.0F});
  targets.family = torch::tensor({0, 1, 1, 1, -1, 0}, torch::kInt64);
  batch.species = torch::tensor({0, 1, 2, 2, -1, -1}, torch::kInt64);
  return batch;
}

TrainingBatch part_of(TrainingBatch batch, const RankPlace& place) {
  const std::int64_t size = kBatch / place.size;
  for_each(batch, [&](torch::Tensor& tensor) { tensor = tensor.narrow(0, place.rank * size, size); });
  return batch;
}

// Averages gradients and nothing else, so that each rank's losses know of no other rank.
class Naive : public Collective {
 public:
  explicit Naive(std::shared_ptr<const Collective> ranks) : ranks_(std::move(ranks)) {}
  int rank() const override { return 0; }
  int size() const override { return 1; }
  std::string transport() const override { return {}; }
  torch::Tensor sum(const torch::Tensor& tensor) const override { return tensor.detach(); }
  torch::Tensor gather(const torch::Tensor& rows) const override { return rows; }
  std::unique_ptr<AveragedBackward> averaged_backward(
      const std::vector<torch::Tensor>& parameters) const override {
    return ranks_->averaged_backward(parameters);
  }

 private:
  std::shared_ptr<const Collective> ranks_;
};

void append_gradients(smal::tensors::NamedTensors& out, const PrimaNet& net) {
  for (const auto& parameter : net.named_parameters()) {
    if (parameter.value().grad().defined()) {
      out.emplace_back("gradient." + parameter.key(), parameter.value().grad().clone());
    }
  }
}

PrimaConfig still(PrimaConfig config) {
  config.dropout = config.drop_path = 0.0;
  return config;
}

smal::tensors::NamedTensors exact_steps(const RankPlace& place, const Collective& ranks) {
  const Prima prima = testing::parity_prima("A", still(testing::parity_config("A")), torch::kFloat64);
  PrimaNet& net = prima.net();
  net.train();
  Priors priors = load_priors(testing::parity_file("weights_A"), torch::kCPU);
  for (torch::Tensor* tensor :
       {&priors.mean_pose, &priors.precs, &priors.use_index, &priors.mean_betas, &priors.betas_prec}) {
    *tensor = tensor->to(torch::kFloat64);
  }
  TrainingBatch batch =
      part_of(joint_batch(smal::tensors::SmalBody(testing::load_parity_asset(testing::parity_dir()))), place);
  for_each(batch, [](torch::Tensor& tensor) {
    if (tensor.is_floating_point()) tensor = tensor.to(torch::kFloat64);
  });
  AdamW optimiser(parameter_groups(net), {});
  const auto backward = ranks.averaged_backward(optimiser.parameters());
  smal::tensors::NamedTensors out;
  append_parameters(out, "start.", net);
  for (int step = 0; step < kSteps; ++step) {
    optimiser.zero_grad();
    const ImageFeatures features = net.encode(batch.images);
    const torch::Tensor betas = net.decoder().initial_betas(features.bio_token);
    const DecoderOutput decoded = net.decoder().refine(net.decoder().remember(features.image_tokens), betas,
                                                       net.decoder().own_parameters());
    const Prediction prediction = assemble(net, prima.body(), decoded, betas, /*with_vertices=*/false);
    const LossTerms terms =
        loss_terms(prediction, batch.targets, priors, settings::LossVariant::sound, ranks);
    backward->run(total_loss(terms, {}));
    if (step == 0) append_gradients(out, net);
    optimiser.step(kRate);
  }
  append_parameters(out, "weight.", net);
  out.emplace_back("without_pose", (1.0 - batch.targets.has_pose).sum());
  out.emplace_back("without_betas", (1.0 - batch.targets.has_betas).sum());
  out.emplace_back("known_species", (batch.species >= 0).sum());
  return out;
}

smal::tensors::NamedTensors learner_steps(const RankPlace& place,
                                          const std::shared_ptr<const Collective>& ranks,
                                          const std::string& mode, const std::filesystem::path& scratch) {
  const bool encoders = mode.starts_with("encoders");
  const bool stemmed = mode.ends_with("_stem");
  PrimaConfig config = still(named_config("tiny"));
  config.embed_dim = 32, config.heads = 2;
  config.clip_width = 32, config.clip_layers = 1, config.clip_heads = 2, config.clip_out = 16;
  config.dec_dim = 32, config.dec_heads = 2, config.dec_ffn = 32;
  config.efficientnet_stem = stemmed;
  const std::filesystem::path stem = testing::source_dir() / "models" / "efficientnet_lite0.safetensors";
  write_initial_checkpoint(scratch, config, /*seed=*/3, torch::kFloat32, stemmed ? stem : "");
  const StemTraining stem_training{.rate_scale = 0.5, .frozen_blocks = 2};
  const smal::tensors::SmalAsset asset = testing::load_parity_asset(testing::parity_dir());
  const smal::tensors::SmalBody body(asset);
  const auto net = load_net(smal::tensors::SafeTensors::open(scratch), config, asset, {});
  std::filesystem::remove(scratch);
  smal::tensors::NamedTensors out;
  append_parameters(out, "start.", *net);
  const RateSchedule schedule{kRate, 0, 0};
  std::unique_ptr<Learner> learner;
  if (encoders) {
    EncoderTrainerOptions options;
    options.schedule = schedule;
    options.species = kSpecies;
    options.stem = stem_training;
    learner = std::make_unique<EncoderTrainer>(net, options, ranks);
  } else {
    TrainerOptions options;
    options.schedule = schedule;
    options.adversarial = true;
    options.stem = stem_training;
    learner = std::make_unique<Trainer>(
        net, body, load_priors(testing::parity_file("weights_A"), torch::kCPU), options, ranks);
  }
  const TrainingBatch batch = part_of(joint_batch(body), place);
  for (int step = 0; step < kSteps; ++step) {
    const StepReport report = learner->step(batch);
    std::vector<double> numbers{report.loss, report.gradient_norm};
    for (const auto& [name, value] : report.terms) numbers.push_back(value);
    out.emplace_back(fmt::format("report.{}", step), torch::tensor(numbers, torch::kFloat64));
    if (step == 0) append_gradients(out, *net);
  }
  append_parameters(out, "weight.", *net);
  for (auto& [name, tensor] : learner->state()) {
    if (name.starts_with("discriminator.")) out.emplace_back("weight." + name, tensor);
  }
  return out;
}

int run(std::string mode, const std::string& out) {
  configure_compute(1);
  RankPlace place = rank_place_from_environment();
  if (mode == "wait") place.join_timeout = std::chrono::seconds(2);
  auto ranks = join_ranks(place, torch::kCPU);
  if (mode == "leave" && place.rank == 1) return 0;
  constexpr std::string_view kNaive = "naive_";
  if (mode.starts_with(kNaive)) {
    mode.erase(0, kNaive.size());
    ranks = std::make_shared<Naive>(ranks);
  }
  const std::string path = fmt::format("{}.{}", out, place.rank);
  smal::tensors::write_safetensors(path, mode == "exact" || mode == "leave"
                                             ? exact_steps(place, *ranks)
                                             : learner_steps(place, ranks, mode, path + ".initial"));
  return 0;
}

}  // namespace
}  // namespace q3d::model::ranks

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  try {
    return q3d::model::ranks::run(argv[1], argv[2]);
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
}
