#include "pipeline/training/training_run.h"

#include <fmt/format.h>
#include <torch/types.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/lock.h"
#include "manifests/random.h"
#include "model/checkpoint.h"
#include "model/device.h"
#include "model/encoder_trainer.h"
#include "model/mixed_precision.h"
#include "model/module_state.h"
#include "model/priors.h"
#include "model/ranks/process_group.h"
#include "model/ranks/rank_place.h"
#include "model/trainer.h"
#include "pipeline/config/device_names.h"
#include "pipeline/device/domain.h"
#include "pipeline/run/command_line.h"
#include "pipeline/run/errors.h"
#include "pipeline/run/interrupt.h"
#include "pipeline/run/log.h"
#include "pipeline/run/progress.h"
#include "pipeline/training/batch_tensors.h"
#include "pipeline/training/held_out.h"
#include "pipeline/training/initial_net.h"
#include "pipeline/training/rank_agreement.h"
#include "pipeline/training/training_log.h"
#include "pipeline/training/training_pools.h"
#include "pipeline/training/training_state.h"
#include "smal/camera.h"
#include "smal/sizes.h"
#include "smal/tensors/asset.h"
#include "smal/tensors/body.h"

namespace q3d::pipeline::training {
namespace {

namespace fs = std::filesystem;
using settings::Decay;
using settings::ModelDtype;
using settings::Objective;
using settings::PhaseConfig;
using settings::PoolConfig;
using settings::Precision;
using settings::TrainingConfig;
using settings::TrainingNetworkConfig;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

fs::path made(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw std::runtime_error(fmt::format("{}: cannot make the folder: {}", folder.string(), error.message()));
  }
  return folder;
}

model::ranks::RankPlace find_place(const std::string& device) {
  try {
    model::ranks::RankPlace place = model::ranks::rank_place_from_environment();
    config::require_device_for_each_rank(device, place.local_size);
    model::ranks::tell_launcher(place);
    return place;
  } catch (const std::invalid_argument& error) {
    throw run::ConfigError(error.what());
  }
}

model::DeviceChoice choose_device(const TrainingNetworkConfig& network,
                                  const model::ranks::RankPlace& place) {
  model::configure_compute(network.compute_threads > 0 ? network.compute_threads : own_cores(place));
  try {
    return model::choose_device(config::device_of_rank(network.device, place.local_rank), place.local_rank);
  } catch (const std::invalid_argument& error) {
    throw run::ConfigError(error.what());
  }
}

// Returns the config with the precision "auto" replaced by the one that suits the device. The run's key keeps
// "auto", because it does not depend on the device.
TrainingConfig for_device(TrainingConfig config, torch::Device device) {
  Precision& precision = config.network.precision;
  if (precision == Precision::automatic) {
    precision = model::bfloat16_is_fast(device) ? Precision::bfloat16 : Precision::float32;
  }
  return config;
}

// Returns a digest over everything that decides the weights except device and threads: effective settings,
// assets and samples. All files are read, which takes little time compared with a training.
std::string run_key(const TrainingConfig& config, const nlohmann::json& samples) {
  nlohmann::json assets = nlohmann::json::array();
  const TrainingNetworkConfig& network = config.network;
  if (!fs::exists(network.priors)) {
    throw run::ConfigError(fmt::format(
        "{}: there is no such file, expected the pose and shape priors. `{}` writes those of the "
        "synthetic quadruped; an official checkpoint holds its own",
        network.priors.string(), run::command_line({"init", "--priors", network.priors.string()})));
  }
  for (const fs::path& path : {network.initial, network.encoders, network.smal_asset, network.priors}) {
    assets.push_back(path.empty() ? std::string() : manifests::sha256_file(path));
  }
  return manifests::sha256(nlohmann::json{settings::deciding_values(config), assets, samples}.dump());
}

model::TrainerOptions trainer_options(const TrainingConfig& config, const PhaseConfig& phase) {
  model::TrainerOptions options;
  options.weights = config.loss_weights;
  options.variant = config.loss_variant;
  options.adamw.weight_decay = config.weight_decay;
  options.backbone_rate_scale = config.backbone_rate;
  options.stem = {config.stem_rate, config.frozen_stem_blocks};
  options.schedule = {phase.learning_rate, phase.warm_up_steps,
                      phase.decay == Decay::linear ? phase.steps : 0};
  options.largest_gradient_norm = config.largest_gradient_norm;
  options.precision = config.network.precision == Precision::bfloat16 ? model::Precision::bfloat16
                                                                      : model::Precision::float32;
  options.parts = config.batch_parts;
  options.adversarial = phase.adversarial;
  options.seed = config.seed;
  return options;
}

model::EncoderTrainerOptions encoder_options(const TrainingConfig& config, const PhaseConfig& phase,
                                             std::size_t species) {
  const model::TrainerOptions common = trainer_options(config, phase);
  model::EncoderTrainerOptions options;
  options.adamw = common.adamw;
  options.schedule = common.schedule;
  options.stem = common.stem;
  options.largest_gradient_norm = common.largest_gradient_norm;
  options.precision = common.precision;
  options.parts = common.parts;
  options.species = static_cast<std::int64_t>(species);
  options.seed = config.seed;
  return options;
}

// Returns the seed of the draws of a phase.
std::uint64_t phase_seed(const TrainingConfig& config, int phase_index) {
  return manifests::Rng(config.seed, {static_cast<std::uint64_t>(phase_index)}).next();
}

// Returns the seed of dropout and stochastic depth in one step. Ranks have different seeds, and a resumed run
// needs no stored generator.
std::uint64_t step_seed(const TrainingConfig& config, const TrainingPosition& position, int rank) {
  return manifests::Rng(config.seed,
                        {static_cast<std::uint64_t>(position.phase),
                         static_cast<std::uint64_t>(position.step), static_cast<std::uint64_t>(rank)})
      .next();
}

feed::Feed open_feed(const TrainingConfig& config, const PhaseConfig& phase, int phase_index, int threads,
                     const TrainingPools& samples, const model::ranks::Collective& ranks) {
  std::vector<feed::ShardPool> pools;
  std::vector<double> weights;
  for (const PoolConfig& pool : phase.pools) {
    pools.push_back(samples.open(pool.name));
    weights.push_back(pool.weight);
  }
  feed::FeedOptions options = config.feed;
  options.threads = threads;
  options.rank = ranks.rank();
  options.ranks = ranks.size();
  const int own_samples = options.batch / ranks.size();
  if (config.batch_parts > own_samples) {
    throw run::ConfigError(
        fmt::format("batch_parts: got {}, expected at most {}, the samples of a batch on one rank",
                    config.batch_parts, own_samples));
  }
  try {
    // Each phase draws from its own random stream.
    return {std::move(pools), weights, options, phase_seed(config, phase_index)};
  } catch (const std::invalid_argument& error) {
    throw run::ConfigError(fmt::format("phase \"{}\": {}", phase.name, error.what()));
  }
}

std::vector<PoolConfig> pools_of(const std::vector<PhaseConfig>& phases) {
  std::vector<PoolConfig> pools;
  for (const PhaseConfig& phase : phases) pools.insert(pools.end(), phase.pools.begin(), phase.pools.end());
  return pools;
}

// Returns the held-out pool. Throws ConfigError if training draws from one of its pictures.
TrainingPools held_out_pools(const TrainingConfig& config, const TrainingPools& trained, bool skip_damaged) {
  if (config.domain.held_out.empty()) return {{}, skip_damaged};
  TrainingPools pools({config.domain.held_out_pool}, skip_damaged);
  const std::set<std::string> unseen = pools.open(config.domain.held_out).pictures();
  for (const auto& [name, shards] : trained.identity().items()) {
    const std::set<std::string> seen = trained.open(name).pictures();
    const auto shared = std::count_if(seen.begin(), seen.end(),
                                      [&](const std::string& picture) { return unseen.contains(picture); });
    if (shared == 0) continue;
    throw run::ConfigError(fmt::format(
        "domain: held_out: {} of the {} pictures of the pool {} are in the pool {} too, which this stage "
        "trains on; expected pictures that training does not see",
        shared, unseen.size(), config.domain.held_out, name));
  }
  return pools;
}

class Run {
 public:
  Run(const TrainingConfig& config, const TrainingOptions& options)
      : options_(options),
        place_(find_place(config.network.device)),
        device_(choose_device(config.network, place_)),
        config_(for_device(config, device_.device)),
        ranks_(model::ranks::join_ranks(place_, device_.device)),
        lock_(leads() ? std::make_unique<manifests::FolderLock>(made(options.out)) : nullptr),
        asset_(smal::tensors::load_asset(config.network.smal_asset)),
        priors_(model::load_priors(smal::tensors::SafeTensors::open(config.network.priors), device_.device)),
        pools_(pools_of(config.phases), options.skip_damaged),
        held_out_(held_out_pools(config, pools_, options.skip_damaged)),
        key_(run_key(config, pools_.identity())),
        stored_(load_state(state_path(), key_)) {
    if (stored_) position_ = stored_->position;
    require_same_run(*ranks_, key_, position_);
    if (!leads()) return;
    manifests::remove_temporaries(options.out);
    tell_left_out();
    if (options.quiet) return;
    if (!device_.warning.empty()) run::log_warning(device_.warning);
    if (config_.network.precision == Precision::bfloat16 && !model::multiplies_in_bfloat16(device_.device)) {
      run::log_warning(
          "this processor does not multiply in bfloat16 (AVX512_BF16), so convolutions in it are about ten "
          "times slower than in float32; \"precision\": \"auto\" takes the faster");
    }
    run::log_info(
        fmt::format("training on {} in {}", device_.description, to_string(config_.network.precision)));
    if (ranks_->size() > 1) {
      run::log_info(fmt::format("{} ranks, each with {} of a batch's {} samples, over {}", ranks_->size(),
                                config.feed.batch / ranks_->size(), config.feed.batch, ranks_->transport()));
    }
    if (stored_) {
      run::log_info(fmt::format("going on at step {} of phase {}", position_.step, position_.phase + 1));
    }
  }

  TrainingSummary run() {
    TrainingSummary summary;
    summary.rank = ranks_->rank();
    summary.left_out = left_out();
    for (const PhaseConfig& phase : config_.phases) summary.steps_total += phase.steps;
    std::optional<TrainingLog> log;
    if (leads()) log.emplace(options_.out / "log.jsonl", position_.phase, position_.step);
    run::Progress progress("trained steps", summary.steps_total, options_.quiet || !leads());
    progress.advance(steps_done(), /*from_earlier_run=*/true);
    auto net = initial_net(config_.network, asset_, device_.device);
    if (stored_) model::restore_parameters(stored_->file, "", *net);
    while (position_.phase < static_cast<int>(config_.phases.size()) && !limit_reached(summary)) {
      net = run_phase(std::move(net), log, progress, summary);
    }
    summary.steps_done = steps_done();
    summary.finished = position_.phase == static_cast<int>(config_.phases.size());
    summary.seconds = seconds_since(start_);
    if (summary.finished) summary.model = write_model(net);
    meet();
    return summary;
  }

 private:
  // Returns what is left out of all pools, the held-out one too.
  std::vector<std::string> left_out() const {
    std::vector<std::string> lines = pools_.left_out();
    lines.insert(lines.end(), held_out_.left_out().begin(), held_out_.left_out().end());
    return lines;
  }

  void tell_left_out() const {
    constexpr std::size_t kShown = 20;
    const std::vector<std::string> lines = left_out();
    for (std::size_t i = 0; i < std::min(kShown, lines.size()); ++i)
      run::log_warning("left out: " + lines[i]);
    if (lines.size() > kShown) {
      run::log_warning(fmt::format("left out: {} more, which --json names", lines.size() - kShown));
    }
  }

  // Returns whether this is rank 0, which alone writes.
  bool leads() const { return ranks_->rank() == 0; }

  // Waits until all ranks have called it.
  void meet() const { ranks_->sum(torch::zeros({1})); }

  bool any_rank_interrupted() const {
    return ranks_->sum(torch::tensor({run::interrupted() ? 1 : 0})).item<int>() > 0;
  }

  void save(const model::Learner& learner, const std::optional<TrainingLog>& log) const {
    if (log) log->sync();  // before the state, which says that these steps are done
    if (leads()) save_state(state_path(), learner, position_, key_);
    meet();  // a rank that ended earlier would make its launcher stop rank 0 while it writes
  }

  fs::path state_path() const { return options_.out / "state.safetensors"; }

  std::int64_t steps_done() const {
    std::int64_t done = position_.step;
    for (int i = 0; i < position_.phase; ++i) done += config_.phases[static_cast<std::size_t>(i)].steps;
    return done;
  }

  bool limit_reached(const TrainingSummary& summary) const {
    return options_.max_steps > 0 && summary.steps_here >= options_.max_steps;
  }

  std::unique_ptr<model::Learner> make_learner(const std::shared_ptr<model::PrimaNet>& net,
                                               const PhaseConfig& phase, const feed::Feed& feed) const {
    try {
      if (phase.objective == Objective::encoders) {
        return std::make_unique<model::EncoderTrainer>(
            net, encoder_options(config_, phase, feed.species().size()), ranks_);
      }
      return std::make_unique<model::Trainer>(net, smal::tensors::SmalBody(asset_, device_.device), priors_,
                                              trainer_options(config_, phase), ranks_);
    } catch (const std::invalid_argument& error) {
      throw run::ConfigError(fmt::format("phase \"{}\": {}", phase.name, error.what()));
    }
  }

  // Runs the current phase from the current step to its end, or until this call must stop.
  std::shared_ptr<model::PrimaNet> run_phase(std::shared_ptr<model::PrimaNet> from,
                                             std::optional<TrainingLog>& log, run::Progress& progress,
                                             TrainingSummary& summary) {
    const PhaseConfig& phase = config_.phases[static_cast<std::size_t>(position_.phase)];
    model::PrimaConfig sizes = from->config();
    sizes.ief_iterations = phase.ief_iterations;
    const auto net = model::with_config(*from, sizes);
    from.reset();  // at full size it takes 3.5 GB
    net->recompute_blocks(config_.network.recompute);
    const int threads = options_.threads == 0 && place_.size > 1 ? own_cores(place_) : options_.threads;
    const feed::Feed feed = open_feed(config_, phase, position_.phase, threads, pools_, *ranks_);
    const std::unique_ptr<model::Learner> learner = make_learner(net, phase, feed);
    if (stored_ && position_.step > 0) learner->restore(stored_->file);
    stored_.reset();
    feed::FeedStream stream(feed, position_.step * feed.batch_size(), config_.feed_ahead);
    while (position_.step < phase.steps) {
      if (any_rank_interrupted()) {
        save(*learner, log);
        throw run::Interrupted("interrupted");
      }
      if (limit_reached(summary)) break;
      step(phase, *learner, feed, stream.next(), log, summary);
      progress.advance(1);
      if (position_.step % config_.checkpoint_every == 0 && position_.step < phase.steps) {
        save(*learner, log);
      }
    }
    if (position_.step == phase.steps) position_ = {position_.phase + 1, 0, {}};
    save(*learner, log);
    return net;
  }

  void step(const PhaseConfig& phase, model::Learner& learner, const feed::Feed& feed,
            feed::FeedBatch&& batch, std::optional<TrainingLog>& log, TrainingSummary& summary) {
    const std::int64_t first_draw = batch.first_draw;
    at::manual_seed(step_seed(config_, position_, ranks_->rank()));
    const model::StepReport report = learner.step(to_tensors(std::move(batch)));
    const auto fault = position_.watch.check(report.loss, report.gradient_norm, config_.divergence_factor);
    if (fault) stop(phase, *fault, report, feed.ids(first_draw));
    ++position_.step;
    ++summary.steps_here;
    summary.last_loss = report.loss;
    if (!log || (position_.step % config_.log_every != 0 && position_.step != phase.steps)) return;
    const double seconds = seconds_since(start_);
    log->write({position_.phase, phase.name, position_.step, report.loss, report.gradient_norm,
                report.learning_rate,
                static_cast<double>(summary.steps_here * feed.batch_size()) / std::max(seconds, 1e-9),
                seconds, report.terms});
  }

  [[noreturn]] void stop(const PhaseConfig& phase, const std::string& fault, const model::StepReport& report,
                         const std::vector<std::string>& ids) const {
    if (!leads()) {  // all ranks see the same loss; one message is enough
      throw std::runtime_error(
          fmt::format("rank {}: stopped for the reason that rank 0 gives", ranks_->rank()));
    }
    std::string message = fmt::format(
        "training stopped at step {} of phase \"{}\": {}\nthe terms of the loss:", position_.step + 1,
        phase.name, fault);
    for (const auto& [name, value] : report.terms) message += fmt::format(" {} {};", name, value);
    message += "\nthe batch's samples:";
    for (const std::string& id : ids) message += "\n  " + id;
    message += fmt::format(
        "\n{} holds the last good state; a lower learning_rate or a largest_gradient_norm may help",
        state_path().string());
    throw std::runtime_error(message);
  }

  // Returns the domain for the finished weights' metadata. It is empty if the config says nothing about it,
  // and for weights whose last phase trained only the encoders, because such a network predicts no bodies
  // yet.
  std::map<std::string, std::string> domain_of(const std::shared_ptr<model::PrimaNet>& net) const {
    const settings::DomainConfig& domain = config_.domain;
    if (domain.pictures.empty() || config_.phases.back().objective != Objective::prima) return {};
    device::NetworkDomain described{
        device::pictures_from_string(domain.pictures), domain.trained_on, {}, 0, {}};
    if (!domain.held_out.empty()) {
      if (!options_.quiet) run::log_info(fmt::format("predicting {} held-out samples", domain.samples));
      feed::FeedOptions feed = config_.feed;
      feed.augment = false;
      feed.threads = options_.threads;
      std::vector<feed::ShardPool> pools;
      pools.push_back(held_out_.open(domain.held_out));
      described = measure_domain(domain, net, smal::tensors::SmalBody(asset_, device_.device),
                                 feed::Feed(std::move(pools), {1.0}, feed, config_.seed));
    }
    return {{device::kDomainKey, device::to_json(described)}};
  }

  fs::path write_model(const std::shared_ptr<model::PrimaNet>& net) const {
    const fs::path path = options_.out / "model.safetensors";
    if (!leads()) return path;
    smal::tensors::NamedTensors tensors;
    model::append_parameters(tensors, "", *net);
    if (config_.model_dtype == ModelDtype::float16) {
      for (auto& [name, tensor] : tensors) tensor = tensor.to(torch::kFloat16);
    }
    std::map<std::string, std::string> metadata = domain_of(net);
    metadata.merge(stem_origin(config_.network));
    model::write_checkpoint(path, net->config(), tensors, metadata);
    return path;
  }

  const TrainingOptions& options_;
  Clock::time_point start_ = Clock::now();
  model::ranks::RankPlace place_;
  model::DeviceChoice device_;
  TrainingConfig config_;
  std::shared_ptr<const model::ranks::Collective> ranks_;
  std::unique_ptr<manifests::FolderLock> lock_;  // held by rank 0
  smal::tensors::SmalAsset asset_;
  model::Priors priors_;
  TrainingPools pools_;
  TrainingPools held_out_;  // has no pool if the config names none
  std::string key_;
  std::optional<StoredState> stored_;
  TrainingPosition position_;
};

}  // namespace

TrainingSummary train(const TrainingConfig& config, const TrainingOptions& options) {
  return Run(config, options).run();
}

}  // namespace q3d::pipeline::training
