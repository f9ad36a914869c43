#include "pipeline/training/training_config.h"

#include <fmt/format.h>

#include <map>
#include <span>

#include "pipeline/config/config_layers.h"
#include "pipeline/config/json_fields.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::training {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

void require(bool holds, const std::string& where, const std::string& what) {
  if (!holds) throw run::ConfigError(where + ": " + what);
}

std::vector<std::string> texts(const json& list, const std::string& where) {
  require(list.is_array() && !list.empty(), where, "must be a list of texts with at least one");
  std::vector<std::string> values;
  for (const json& value : list) {
    require(value.is_string(), where, "must be a list of texts, got " + value.dump());
    values.push_back(value.get<std::string>());
  }
  return values;
}

// Returns the enumerator of a word. Throws ConfigError that lists the words.
template <typename Enum>
Enum choice(const std::string& word, std::span<const std::string_view> names,
            Enum (*from_string)(std::string_view), const std::string& where) {
  config::require_one_of(word, {names.begin(), names.end()}, where);
  return from_string(word);
}

void parse_network(const json& object, const std::string& where, TrainingNetworkConfig& network) {
  std::string initial, encoders, smal_asset, priors;
  std::string precision(to_string(network.precision));
  config::JsonFields fields(object, where);
  fields.require("initial", initial);
  fields.read("encoders", encoders);
  fields.require("smal_asset", smal_asset);
  fields.require("priors", priors);
  if (const json* parts = fields.child("without")) {
    network.without = texts(*parts, where + ": without");
    for (const std::string& part : network.without) {
      config::require_one_of(part, {"bio_features", "initial_betas", "keypoint_tokens"}, where + ": without");
    }
  }
  fields.read("device", network.device);
  fields.read("precision", precision);
  fields.read("compute_threads", network.compute_threads);
  fields.finish();
  network.precision = choice(precision, precision_names(), precision_from_string, where + ": precision");
  require(network.compute_threads >= 0, where, "\"compute_threads\" must be 0 (all cores) or more");
  network.initial = initial;
  network.encoders = encoders;
  network.smal_asset = smal_asset;
  network.priors = priors;
}

std::map<std::string, PoolConfig> parse_pools(const json& object, const std::string& where) {
  require(object.is_object() && !object.empty(), where, "must be an object of pools with at least one");
  std::map<std::string, PoolConfig> pools;
  for (const auto& [name, value] : object.items()) {
    const std::string here = where + "." + name;
    config::JsonFields fields(value, here);
    PoolConfig pool{name, {}, 1.0};
    const json* shards = fields.child("shards");
    require(shards != nullptr, here, "the key \"shards\" is missing");
    for (const std::string& path : texts(*shards, here + ": shards")) pool.shards.emplace_back(path);
    fields.read("weight", pool.weight);
    fields.finish();
    require(pool.weight >= 0.0, here, fmt::format("\"weight\" must be 0 or more, got {}", pool.weight));
    pools.emplace(name, std::move(pool));
  }
  return pools;
}

PhaseConfig parse_phase(const json& object, const std::string& where,
                        const std::map<std::string, PoolConfig>& pools) {
  PhaseConfig phase;
  std::string objective(to_string(phase.objective));
  std::string decay(to_string(phase.decay));
  int steps = 0;
  int warm_up_steps = 0;
  config::JsonFields fields(object, where);
  fields.require("name", phase.name);
  fields.read("objective", objective);
  fields.require("steps", steps);
  fields.read("ief_iterations", phase.ief_iterations);
  fields.read("adversarial", phase.adversarial);
  fields.read("learning_rate", phase.learning_rate);
  fields.read("warm_up_steps", warm_up_steps);
  fields.read("decay", decay);
  const json* names = fields.child("pools");
  fields.finish();
  require(names != nullptr, where, "the key \"pools\" is missing");
  std::vector<std::string> known;
  for (const auto& [name, pool] : pools) known.push_back(name);
  for (const std::string& name : texts(*names, where + ": pools")) {
    config::require_one_of(name, known, where + ": pools");
    phase.pools.push_back(pools.at(name));
  }
  phase.objective = choice(objective, objective_names(), objective_from_string, where + ": objective");
  require(steps >= 1, where, fmt::format("\"steps\" must be at least 1, got {}", steps));
  require(warm_up_steps >= 0 && warm_up_steps < steps, where,
          fmt::format("\"warm_up_steps\" must be 0 to less than \"steps\", got {}", warm_up_steps));
  require(phase.ief_iterations >= 1 && phase.ief_iterations <= 16, where,
          "\"ief_iterations\" must be 1 to 16");
  require(phase.learning_rate > 0.0, where, "\"learning_rate\" must be greater than 0");
  phase.decay = choice(decay, decay_names(), decay_from_string, where + ": decay");
  phase.steps = steps;
  phase.warm_up_steps = warm_up_steps;
  return phase;
}

std::vector<PhaseConfig> parse_stage(const json& stages, const std::string& where, const std::string& stage,
                                     const std::map<std::string, PoolConfig>& pools) {
  require(stages.is_object(), where, "must be an object of stages");
  std::vector<std::string> known;
  for (const auto& [name, phases] : stages.items()) known.push_back(name);
  config::require_one_of(stage, known, where);
  const json& phases = stages.at(stage);
  require(phases.is_array() && !phases.empty(), where + "." + stage,
          "must be a list of phases with at least one");
  std::vector<PhaseConfig> result;
  for (std::size_t i = 0; i < phases.size(); ++i) {
    result.push_back(parse_phase(phases[i], fmt::format("{}.{}[{}]", where, stage, i), pools));
  }
  return result;
}

void parse_augmentation(const json& object, const std::string& where,
                        loaders::pictures::AugmentOptions& options) {
  config::JsonFields fields(object, where);
  fields.read("scale", options.scale);
  fields.read("rotation_deg", options.rotation_deg);
  fields.read("rotation_rate", options.rotation_rate);
  fields.read("mirror_rate", options.mirror_rate);
  fields.read("shift", options.shift);
  fields.read("colour", options.colour);
  fields.finish();
  require(options.scale >= 0.0 && options.scale < 1.0, where, "\"scale\" must be 0 to less than 1");
  require(options.rotation_rate >= 0.0 && options.rotation_rate <= 1.0, where,
          "\"rotation_rate\" must be 0 to 1");
  require(options.mirror_rate >= 0.0 && options.mirror_rate <= 1.0, where, "\"mirror_rate\" must be 0 to 1");
  require(options.rotation_deg >= 0.0 && options.rotation_deg <= 90.0, where,
          "\"rotation_deg\" must be 0 to 90");
  require(options.shift >= 0.0 && options.shift < 1.0, where, "\"shift\" must be 0 to less than 1");
  require(options.colour >= 0.0 && options.colour < 1.0, where, "\"colour\" must be 0 to less than 1");
}

void parse_feed(config::JsonFields& fields, const std::string& where, TrainingConfig& config) {
  std::string weight = "label";
  fields.read("batch", config.feed.batch);
  fields.read("feed_ahead", config.feed_ahead);
  fields.read("augment", config.feed.augment);
  fields.read("keypoint_weight", weight);
  if (const json* augmentation = fields.child("augmentation")) {
    parse_augmentation(*augmentation, where + ": augmentation", config.feed.augmentation);
  }
  require(config.feed.batch >= 1 && config.feed.batch <= 65536, where, "\"batch\" must be 1 to 65536");
  require(config.feed_ahead >= 0 && config.feed_ahead <= 64, where, "\"feed_ahead\" must be 0 to 64");
  config::require_one_of(weight, {"label", "raw_v"}, where + ": keypoint_weight");
  config.feed.keypoint_weight = weight == "raw_v" ? feed::KeypointWeight::raw_v : feed::KeypointWeight::label;
}

void parse_loss_weights(const json& object, const std::string& where, model::LossWeights& weights) {
  config::JsonFields fields(object, where);
  fields.read("keypoints_3d", weights.keypoints_3d);
  fields.read("keypoints_2d", weights.keypoints_2d);
  fields.read("aux_keypoints_2d", weights.aux_keypoints_2d);
  fields.read("aux_keypoints_3d", weights.aux_keypoints_3d);
  fields.read("global_orient", weights.global_orient);
  fields.read("pose", weights.pose);
  fields.read("betas", weights.betas);
  fields.read("contrastive", weights.contrastive);
  fields.read("adversarial", weights.adversarial);
  fields.finish();
}

void parse_optimisation(config::JsonFields& fields, const std::string& where, TrainingConfig& config) {
  std::string variant = "sound";
  std::string dtype(to_string(config.model_dtype));
  int checkpoint_every = static_cast<int>(config.checkpoint_every);
  int log_every = static_cast<int>(config.log_every);
  if (const json* weights = fields.child("loss_weights")) {
    parse_loss_weights(*weights, where + ": loss_weights", config.loss_weights);
  }
  fields.read("loss_variant", variant);
  fields.read("backbone_rate", config.backbone_rate);
  fields.read("weight_decay", config.weight_decay);
  fields.read("largest_gradient_norm", config.largest_gradient_norm);
  fields.read("divergence_factor", config.divergence_factor);
  fields.read("model_dtype", dtype);
  fields.read("seed", config.seed);
  fields.read("checkpoint_every", checkpoint_every);
  fields.read("log_every", log_every);
  config::require_one_of(variant, {"sound", "official"}, where + ": loss_variant");
  config.model_dtype = choice(dtype, model_dtype_names(), model_dtype_from_string, where + ": model_dtype");
  require(config.backbone_rate >= 0.0, where, "\"backbone_rate\" must be 0 or more");
  require(config.weight_decay >= 0.0, where, "\"weight_decay\" must be 0 or more");
  require(config.largest_gradient_norm >= 0.0, where,
          "\"largest_gradient_norm\" must be 0 (no clipping) or more");
  require(config.divergence_factor > 1.0, where, "\"divergence_factor\" must be greater than 1");
  require(checkpoint_every >= 1 && log_every >= 1, where,
          "\"checkpoint_every\" and \"log_every\" must be at least 1");
  config.loss_variant = variant == "official" ? model::LossVariant::official : model::LossVariant::sound;
  config.checkpoint_every = checkpoint_every;
  config.log_every = log_every;
}

void resolve_paths(json& config, const fs::path& folder) {
  if (config.contains("network")) {
    for (const char* key : {"initial", "encoders", "smal_asset", "priors"}) {
      config::resolve_path(config["network"], key, folder);
    }
  }
  if (!config.contains("pools") || !config["pools"].is_object()) return;
  for (auto& pool : config["pools"]) {
    if (!pool.is_object() || !pool.contains("shards") || !pool["shards"].is_array()) continue;
    for (auto& path : pool["shards"]) {
      if (path.is_string()) path = (folder / path.get<std::string>()).lexically_normal().string();
    }
  }
}

}  // namespace

TrainingConfig parse_training_config(const json& merged, const std::string& where, const std::string& stage) {
  TrainingConfig config;
  config::JsonFields fields(merged, where);
  const auto child = [&](const char* key) -> const json& {
    const json* found = fields.child(key);
    if (found == nullptr) throw run::ConfigError(fmt::format("{}: the key \"{}\" is missing", where, key));
    return *found;
  };
  parse_network(child("network"), where + ": network", config.network);
  const auto pools = parse_pools(child("pools"), where + ": pools");
  config.phases = parse_stage(child("stages"), where + ": stages", stage, pools);
  parse_feed(fields, where, config);
  parse_optimisation(fields, where, config);
  fields.finish();
  config.as_written = merged;
  return config;
}

TrainingConfig load_training_config(const std::vector<fs::path>& files, const std::string& stage) {
  config::ConfigLayers layers = config::read_config_layers(files, resolve_paths);
  TrainingConfig config = parse_training_config(layers.resolved, layers.where, stage);
  config.as_written = std::move(layers.as_written);
  return config;
}

}  // namespace q3d::pipeline::training
