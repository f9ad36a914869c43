#include "pipeline/training/settings/training_config.h"

#include <fmt/format.h>

#include <map>

#include "pipeline/config/config_layers.h"
#include "pipeline/config/device_names.h"
#include "pipeline/config/json_fields.h"
#include "pipeline/run/errors.h"
#include "pipeline/training/settings/training_settings.h"

namespace q3d::pipeline::training::settings {
namespace {

using config::DecidedStage;
using config::key_parts;
using nlohmann::json;
namespace fs = std::filesystem;
using Pools = std::map<std::string, PoolConfig>;

void require(bool holds, const std::string& where, const std::string& what) {
  if (!holds) throw run::ConfigError(where + ": " + what);
}

template <typename Struct>
void parse_object(const json& object, const std::string& where, const config::Settings<Struct>& settings,
                  Struct& result) {
  config::JsonFields fields(object, where);
  config::read_settings(fields, settings, result);
  fields.finish();
}

void parse_network(const json& object, const std::string& where, TrainingNetworkConfig& network) {
  try {
    parse_object(object, where, training_network_settings(), network);
  } catch (const run::ConfigError& error) {
    if (!object.is_object() || object.contains("priors")) throw;
    throw run::ConfigError(fmt::format(
        "{}. `quadruped3d init --priors FILE` writes the priors of the synthetic quadruped; an official "
        "checkpoint holds its own",
        error.what()));
  }
  config::parse_devices(network.device, where + ": device");
}

Pools parse_pools(const json& object, const std::string& where) {
  require(object.is_object() && !object.empty(), where, "must be an object of pools with at least one");
  Pools pools;
  for (const auto& [name, value] : object.items()) {
    PoolConfig pool;
    pool.name = name;
    parse_object(value, where + "." + name, pool_settings(), pool);
    pools.emplace(name, std::move(pool));
  }
  return pools;
}

PhaseConfig parse_phase(const json& object, const std::string& where, const Pools& pools) {
  PhaseConfig phase;
  parse_object(object, where, phase_settings(), phase);
  require(phase.warm_up_steps < phase.steps, where,
          fmt::format("\"warm_up_steps\" must be less than \"steps\", got {}", phase.warm_up_steps));
  std::vector<std::string> known;
  for (const auto& [name, pool] : pools) known.push_back(name);
  for (const std::string& name : phase.pool_names) {
    config::require_one_of(name, known, where + ": pools");
    phase.pools.push_back(pools.at(name));
  }
  return phase;
}

std::vector<PhaseConfig> parse_stage(const json& stages, const std::string& where, const std::string& stage,
                                     const Pools& pools) {
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

DomainConfig parse_domain(const json& object, const std::string& where, const Pools& pools) {
  DomainConfig domain;
  parse_object(object, where, domain_settings(), domain);
  if (domain.held_out.empty()) return domain;
  std::vector<std::string> known;
  for (const auto& [name, pool] : pools) known.push_back(name);
  config::require_one_of(domain.held_out, known, where + ": held_out");
  domain.held_out_pool = pools.at(domain.held_out);
  return domain;
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

json deciding_values(const PhaseConfig& phase) {
  json values = key_parts(phase_settings(), phase, DecidedStage::weights);
  values["pools"] = json::array();
  for (const PoolConfig& pool : phase.pools) {
    json of_pool = key_parts(pool_settings(), pool, DecidedStage::weights);
    of_pool["name"] = pool.name;
    values["pools"].push_back(std::move(of_pool));
  }
  return values;
}

}  // namespace

TrainingConfig parse_training_config(const json& merged, const std::string& where, const std::string& stage) {
  TrainingConfig config;
  config::JsonFields fields(merged, where);
  const auto child = [&](const char* key) -> const json& {
    const json* found = fields.child(key);
    if (found == nullptr) fields.fail_missing(key);
    return *found;
  };
  parse_network(child("network"), where + ": network", config.network);
  const Pools pools = parse_pools(child("pools"), where + ": pools");
  config.phases = parse_stage(child("stages"), where + ": stages", stage, pools);
  config::read_settings(fields, feed_settings(), config.feed);
  config::read_settings(fields, training_settings(), config);
  if (const json* object = fields.child("augmentation")) {
    parse_object(*object, where + ": augmentation", augmentation_settings(), config.feed.augmentation);
  }
  if (const json* object = fields.child("domain")) {
    config.domain = parse_domain(*object, where + ": domain", pools);
  }
  if (const json* object = fields.child("loss_weights")) {
    parse_object(*object, where + ": loss_weights", loss_weight_settings(), config.loss_weights);
  }
  fields.finish();
  return config;
}

TrainingConfig load_training_config(const std::vector<fs::path>& files, const std::string& stage,
                                    const std::vector<std::string>& settings) {
  const config::ConfigLayers layers = config::read_config_layers(files, resolve_paths, settings);
  return parse_training_config(layers.resolved, layers.where, stage);
}

json deciding_values(const TrainingConfig& config) {
  json values = key_parts(training_settings(), config, DecidedStage::weights);
  values["feed"] = key_parts(feed_settings(), config.feed, DecidedStage::weights);
  values["augmentation"] =
      key_parts(augmentation_settings(), config.feed.augmentation, DecidedStage::weights);
  values["loss_weights"] = key_parts(loss_weight_settings(), config.loss_weights, DecidedStage::weights);
  values["network"] = key_parts(training_network_settings(), config.network, DecidedStage::weights);
  values["phases"] = json::array();
  for (const PhaseConfig& phase : config.phases) values["phases"].push_back(deciding_values(phase));
  return values;
}

}  // namespace q3d::pipeline::training::settings
