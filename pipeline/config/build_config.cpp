#include "pipeline/config/build_config.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <set>
#include <string_view>

#include "loaders/keypoints/builtin_topologies.h"
#include "pipeline/config/build_settings.h"
#include "pipeline/config/config_layers.h"
#include "pipeline/config/device_names.h"
#include "pipeline/config/json_fields.h"
#include "pipeline/config/profiles.h"

namespace q3d::pipeline::config {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

void require(bool holds, const std::string& where, const std::string& what) {
  if (!holds) throw run::ConfigError(where + ": " + what);
}

// File systems allow names of 255 bytes, and keys and endings are appended to these names.
constexpr std::size_t kMaxNameBytes = 200;

// Returns whether the text may become a file's name.
bool is_plain_name(std::string_view text) {
  return !text.empty() && text.size() <= kMaxNameBytes &&
         std::all_of(text.begin(), text.end(), [](unsigned char c) {
           return std::isalnum(c) != 0 || c == '_' || c == '.' || c == '-';
         });
}

bool is_version(std::string_view text) {
  const auto dots = std::count(text.begin(), text.end(), '.');
  const bool only_digits_and_dots = text.find_first_not_of("0123456789.") == std::string_view::npos;
  return dots == 2 && only_digits_and_dots && text.front() != '.' && text.back() != '.' &&
         text.find("..") == std::string_view::npos;
}

// Returns whether a format takes a setting of own labels, whose keypoints are not known beforehand.
// Photographs have no keypoints, but they have a species, and their boxes have scores.
bool takes_setting(const std::string& format, const std::string& key) {
  if (format == "photographs") return key == "species" || key == "min_confidence";
  return loaders::formats::takes_topology(format);
}

void read_own_labels(JsonFields& fields, DatasetConfig& dataset) {
  for (const Setting<DatasetConfig>& setting : own_label_settings()) {
    if (takes_setting(dataset.format, setting.key)) {
      read_setting(fields, setting, dataset);
      continue;
    }
    require(fields.child(setting.key) == nullptr, fields.where(),
            fmt::format("\"{}\" belongs to the formats whose keypoints a topology describes (coco, "
                        "deeplabcut, sleap, lightning_pose), got it with \"{}\"",
                        setting.key, dataset.format));
  }
  require(dataset.categories.empty() || dataset.format == "coco", fields.where(),
          "\"categories\" belongs to the format \"coco\"; other files have none");
  require(!dataset.first_frame || dataset.format != "coco", fields.where(),
          "\"first_frame\" is for tables whose rows number the frames of a video; COCO's files name their "
          "pictures");
}

DatasetConfig parse_dataset(const json& object, const std::string& where) {
  DatasetConfig dataset;
  JsonFields fields(object, where);
  read_settings(fields, dataset_settings(), dataset);
  read_own_labels(fields, dataset);
  fields.finish();
  require(is_plain_name(dataset.name), where,
          "\"name\" may hold up to 200 letters, digits, '.', '_' and '-' only, got \"" + dataset.name + "\"");
  require(dataset.role != Role::truth || dataset.format == "prima", where,
          "\"role\": \"truth\" needs a format that gives bodies, which is \"prima\"; got \"" +
              dataset.format + "\". For keypoints alone use \"2d_only\"");
  require(dataset.body_model.empty() || dataset.role == Role::truth, where,
          "\"body_model\" checks the bodies that a file gives, so it needs \"role\": \"truth\"");
  require(!dataset.keypoints_3d_of_body || !dataset.body_model.empty(), where,
          "\"keypoints_3d\": \"body\" needs a \"body_model\" to compute them");
  return dataset;
}

}  // namespace

std::vector<DatasetConfig> parse_datasets(const json& list, const std::string& where) {
  require(list.is_array(), where, "must be a list of objects");
  std::vector<DatasetConfig> datasets;
  for (std::size_t i = 0; i < list.size(); ++i) {
    datasets.push_back(parse_dataset(list[i], fmt::format("{}[{}]", where, i)));
  }
  return datasets;
}

void resolve_dataset_paths(json& object, const char* key, const fs::path& folder) {
  if (!object.is_object() || !object.contains(key) || !object[key].is_array()) return;
  for (json& dataset : object[key]) {
    for (const char* path : {"root", "curation", "body_model"}) resolve_path(dataset, path, folder);
    const bool is_named = dataset.is_object() && dataset.contains("topology") &&
                          dataset["topology"].is_string() &&
                          loaders::keypoints::is_builtin_topology(dataset["topology"].get<std::string>());
    if (!is_named) resolve_path(dataset, "topology", folder);
  }
}

namespace {

LeakageConfig parse_leakage(const json& object, const std::string& where) {
  LeakageConfig leakage;
  JsonFields fields(object, where);
  if (const json* sets = fields.child("test_sets")) {
    leakage.test_sets = parse_datasets(*sets, where + ": test_sets");
  }
  read_settings(fields, leakage_settings(), leakage);
  fields.finish();
  require(!leakage.test_sets.empty(), where, "\"test_sets\" must name at least one dataset");
  return leakage;
}

// Reads an object that has only settings.
template <typename Struct>
void parse_object(const json& object, const std::string& where, const Settings<Struct>& settings,
                  Struct& config) {
  JsonFields fields(object, where);
  read_settings(fields, settings, config);
  fields.finish();
}

void check_tta(const TtaConfig& tta, const std::string& where) {
  require(tta.iterations_min <= tta.iterations_max, where,
          fmt::format("expected 1 <= iterations_min <= iterations_max, got {} and {}", tta.iterations_min,
                      tta.iterations_max));
}

void require_both_taus(const std::optional<double>& tau_low, const std::optional<double>& tau_high,
                       const std::string& where) {
  require(
      tau_low.has_value() == tau_high.has_value(), where,
      "\"tau_low\" and \"tau_high\" belong together: give both, or neither and run `quadruped3d calibrate`");
}

// `names` are those of the config's datasets.
void parse_dataset_thresholds(const json& object, const std::string& where,
                              const std::vector<std::string>& names, FilterConfig& filter) {
  require(object.is_object(), where, "expected a JSON object with a dataset's name for each key");
  for (const auto& [name, limits] : object.items()) {
    require_one_of(name, names, where);
    DatasetThresholds& own = filter.datasets[name];
    parse_object(limits, where + ": " + name, dataset_threshold_settings(), own);
    require_both_taus(own.tau_low, own.tau_high, where + ": " + name);
  }
}

void parse_filter(const json& object, const std::string& where, const std::vector<std::string>& names,
                  FilterConfig& filter) {
  JsonFields fields(object, where);
  read_settings(fields, filter_settings(), filter);
  if (const json* datasets = fields.child("datasets")) {
    parse_dataset_thresholds(*datasets, where + ": datasets", names, filter);
  }
  fields.finish();
  require_both_taus(filter.tau_low, filter.tau_high, where);
}

void check_guards(const GuardConfig& guards, const std::string& where) {
  try {
    filters::check(guards);
  } catch (const std::invalid_argument& error) {
    throw run::ConfigError(where + ": " + error.what());
  }
}

void check_shares(const CalibrateConfig& shares, const std::string& where) {
  require(shares.retained + shares.refined < 1, where,
          "the shares must be greater than 0 and their sum less than 1");
}

void resolve_paths(json& config, const fs::path& folder) {
  if (config.contains("network")) {
    resolve_path(config["network"], "checkpoint", folder);
    resolve_path(config["network"], "smal_asset", folder);
  }
  if (config.contains("guards")) resolve_path(config["guards"], "priors", folder);
  resolve_path(config, "veto", folder);
  resolve_path(config, "corrections", folder);
  resolve_dataset_paths(config, "datasets", folder);
  if (config.contains("leakage")) resolve_dataset_paths(config["leakage"], "test_sets", folder);
}

// Returns the config laid over its profile.
json expand_profile(const json& merged, const std::string& where) {
  std::string profile = BuildConfig().profile;
  JsonFields(merged, where).read("profile", profile);
  require_one_of(profile, profile_names(), where + ": profile");
  json expanded = profile_layer(profile);
  expanded.merge_patch(merged);
  return expanded;
}

std::vector<std::string> names_of(const std::vector<DatasetConfig>& datasets) {
  std::vector<std::string> names;
  names.reserve(datasets.size());
  for (const DatasetConfig& dataset : datasets) names.push_back(dataset.name);
  return names;
}

}  // namespace

namespace {

// Reads the objects below the top level except the datasets.
void parse_parts(JsonFields& fields, const std::string& where, BuildConfig& config) {
  const auto part = [&](const char* key, auto parse) {
    if (const json* object = fields.child(key)) parse(*object, where + ": " + key);
  };
  part("tta", [&](const json& object, const std::string& name) {
    parse_object(object, name, tta_settings(), config.tta);
    check_tta(config.tta, name);
  });
  part("leakage",
       [&](const json& object, const std::string& name) { config.leakage = parse_leakage(object, name); });
  part("filter", [&](const json& object, const std::string& name) {
    parse_filter(object, name, names_of(config.datasets), config.filter);
  });
  part("guards", [&](const json& object, const std::string& name) {
    parse_object(object, name, guard_settings(), config.guards);
    check_guards(config.guards, name);
  });
  part("shards", [&](const json& object, const std::string& name) {
    parse_object(object, name, shard_settings(), config.shards);
  });
  part("calibrate", [&](const json& object, const std::string& name) {
    parse_object(object, name, calibrate_settings(), config.calibrate);
    check_shares(config.calibrate, name);
  });
}

void check_names(const BuildConfig& config, const std::string& where) {
  require(is_plain_name(config.name), where,
          "\"name\" becomes a folder's name: up to 200 letters, digits, '.', '_' and '-' only");
  require(is_version(config.version), where,
          "\"version\" must look like 1.0.0, got \"" + config.version + "\"");
  std::set<std::string> seen;
  for (const auto& dataset : config.datasets) {
    require(seen.insert(dataset.name + "/" + dataset.split).second, where,
            "two datasets have the name and split " + dataset.name + "/" + dataset.split +
                "; sample ids would not be unique");
  }
}

}  // namespace

BuildConfig parse_build_config(const json& merged, const std::string& where, NetworkKey network_key) {
  BuildConfig config;
  const json expanded = expand_profile(merged, where);
  JsonFields fields(expanded, where);
  read_settings(fields, build_settings(), config);
  const json* datasets = fields.child("datasets");
  const json* network = fields.child("network");
  if (datasets != nullptr) config.datasets = parse_datasets(*datasets, where + ": datasets");
  parse_parts(fields, where, config);
  fields.finish();  // first, so that a misspelt key is named rather than the key that then seems missing
  require(!config.datasets.empty(), where, "\"datasets\" must name at least one dataset");
  if (network != nullptr) {
    parse_object(*network, where + ": network", network_settings(), config.network);
    parse_devices(config.network.device, where + ": network: device");
  } else {
    require(!needs_network(config) || network_key == NetworkKey::optional, where,
            "the key \"network\" is missing; a dataset of role \"pseudo\", the default, gets its labels from "
            "it. Datasets that bring theirs have the role \"truth\" or \"2d_only\"");
  }
  check_names(config, where);
  config.as_written = merged;
  return config;
}

BuildConfig load_build_config(const std::vector<fs::path>& files, const std::vector<std::string>& settings,
                              NetworkKey network_key) {
  ConfigLayers layers = read_config_layers(files, resolve_paths, settings);
  BuildConfig config = parse_build_config(layers.resolved, layers.where, network_key);
  config.as_written = std::move(layers.as_written);
  return config;
}

void require_keypoints(const BuildConfig& config) {
  for (const DatasetConfig& dataset : config.datasets) {
    if (dataset.format != "photographs") continue;
    throw run::ConfigError(
        fmt::format("the dataset \"{}\" has the format \"photographs\": it has no keypoints to "
                    "judge a prediction by. `quadruped3d predict` gives its bodies",
                    dataset.name));
  }
}

bool needs_network(const BuildConfig& config) {
  return std::any_of(config.datasets.begin(), config.datasets.end(),
                     [](const DatasetConfig& dataset) { return dataset.role == Role::pseudo; });
}

bool uses_priors(const TtaConfig& tta) {
  return tta.pose_prior_weight > 0.0 || tta.shape_prior_weight > 0.0;
}

bool uses_priors(const GuardConfig& guards) {
  return guards.pose_deviation_max > 0.0 || guards.limb_factor_max > 0.0;
}

fs::path priors_file(const BuildConfig& config) {
  return config.guards.priors.empty() ? config.network.checkpoint : config.guards.priors;
}

}  // namespace q3d::pipeline::config
