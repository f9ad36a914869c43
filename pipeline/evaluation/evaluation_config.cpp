#include "pipeline/evaluation/evaluation_config.h"

#include <fmt/format.h>

#include "pipeline/config/config_layers.h"
#include "pipeline/config/json_fields.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::evaluation {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

void resolve_paths(json& config, const fs::path& folder) {
  if (config.contains("network")) {
    config::resolve_path(config["network"], "checkpoint", folder);
    config::resolve_path(config["network"], "smal_asset", folder);
  }
  if (config.contains("guards")) config::resolve_path(config["guards"], "priors", folder);
  config::resolve_dataset_paths(config, "datasets", folder);
  if (!config.contains("datasets") || !config["datasets"].is_array()) return;
  for (json& dataset : config["datasets"]) {
    for (const char* key : {"truth", "masks"}) config::resolve_path(dataset, key, folder);
  }
}

// Removes a key from `object`, which may be any JSON value, and returns its text; empty if it is absent.
fs::path take_path(json& object, const char* key, const std::string& where) {
  if (!object.is_object() || !object.contains(key)) return {};
  if (!object[key].is_string()) {
    throw run::ConfigError(
        fmt::format("{}: \"{}\" must be a string, got {}", where, key, object[key].dump()));
  }
  const fs::path path = object[key].get<std::string>();
  object.erase(key);
  return path;
}

}  // namespace

EvaluationConfig load_evaluation_config(const std::vector<fs::path>& files, const fs::path& checkpoint,
                                        const std::vector<std::string>& settings) {
  config::ConfigLayers layers = config::read_config_layers(files, resolve_paths, settings);
  json& build = layers.resolved;
  EvaluationConfig config;
  if (build.contains("datasets") && build["datasets"].is_array()) {
    for (std::size_t i = 0; i < build["datasets"].size(); ++i) {
      const std::string where = fmt::format("{}: datasets[{}]", layers.where, i);
      EvaluatedDataset& dataset = config.datasets.emplace_back();
      dataset.truth = take_path(build["datasets"][i], "truth", where);
      dataset.masks = take_path(build["datasets"][i], "masks", where);
      if (dataset.truth.empty() && !dataset.masks.empty()) {
        throw run::ConfigError(where +
                               ": \"masks\" is the folder of a \"truth\" file's masks, and there is no "
                               "\"truth\"; a format's own masks are found without it");
      }
    }
  }
  if (!checkpoint.empty() && (!build.contains("network") || build["network"].is_object())) {
    build["network"]["checkpoint"] = fs::absolute(checkpoint).string();
  }
  const config::BuildConfig parsed = config::parse_build_config(build, layers.where);
  if (parsed.network.checkpoint.empty()) {
    throw run::ConfigError(layers.where +
                           ": the key \"network\" is missing: there is no network to evaluate");
  }
  for (std::size_t i = 0; i < config.datasets.size(); ++i) config.datasets[i].source = parsed.datasets[i];
  config.network = parsed.network;
  config.tta = parsed.tta;
  config.priors = config::priors_file(parsed);
  config.as_written = std::move(layers.as_written);
  return config;
}

}  // namespace q3d::pipeline::evaluation
