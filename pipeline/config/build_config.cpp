#include "pipeline/config/build_config.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <set>
#include <string_view>

#include "filters/near_duplicates.h"
#include "pipeline/config/config_layers.h"
#include "pipeline/config/json_fields.h"
#include "pipeline/config/profiles.h"

namespace q3d::pipeline::config {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

void require(bool holds, const std::string& where, const std::string& what) {
  if (!holds) throw run::ConfigError(where + ": " + what);
}

// What may become a file's name.
bool is_plain_name(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '_' || c == '.' || c == '-';
  });
}

bool is_version(std::string_view text) {
  const auto dots = std::count(text.begin(), text.end(), '.');
  const bool only_digits_and_dots = text.find_first_not_of("0123456789.") == std::string_view::npos;
  return dots == 2 && only_digits_and_dots && text.front() != '.' && text.back() != '.' &&
         text.find("..") == std::string_view::npos;
}

// What only labels of one's own need: their keypoints are not known beforehand.
void read_label_options(JsonFields& fields, DatasetConfig& options) {
  const bool is_own = options.format == "coco" || options.format == "deeplabcut";
  for (const char* key : {"topology", "species", "min_confidence", "box_margin"}) {
    require(is_own || fields.child(key) == nullptr, fields.where(),
            fmt::format("\"{}\" belongs to the formats \"coco\" and \"deeplabcut\", got it with \"{}\"", key,
                        options.format));
  }
  if (!is_own) return;
  std::string topology;
  fields.require("topology", topology);
  fields.read("species", options.species);
  fields.read("min_confidence", options.min_confidence);
  fields.read("box_margin", options.box_margin);
  require(options.min_confidence >= 0 && options.min_confidence <= 1, fields.where(),
          fmt::format("\"min_confidence\" must be 0 to 1, got {}", options.min_confidence));
  require(options.box_margin >= 0 && options.box_margin <= 2, fields.where(),
          fmt::format("\"box_margin\" must be 0 to 2, got {}", options.box_margin));
  options.topology = topology;
}

DatasetConfig parse_dataset(const json& object, const std::string& where) {
  DatasetConfig options;
  std::string root;
  std::string annotations;
  std::string images;
  std::string role(to_string(options.role));
  std::string curation;
  std::string body_model;
  std::string keypoints_3d = "file";
  JsonFields fields(object, where);
  fields.require("name", options.name);
  fields.require("format", options.format);
  fields.require("root", root);
  fields.require("annotations", annotations);
  options.split = "train";
  fields.read("split", options.split);
  fields.read("images", images);
  fields.read("role", role);
  fields.read("curation", curation);
  fields.read("body_model", body_model);
  fields.read("keypoints_3d", keypoints_3d);
  read_label_options(fields, options);
  fields.finish();
  require_one_of(options.format, loaders::formats::dataset_formats(), where + ": format");
  require(is_plain_name(options.name), where,
          "\"name\" may hold letters, digits, '.', '_' and '-' only, got \"" + options.name + "\"");
  require_one_of(role, role_names(), where + ": role");
  options.role = role_from_string(role);
  require(options.role != Role::truth || options.format == "prima", where,
          "\"role\": \"truth\" needs a format that gives bodies, which is \"prima\"; got \"" +
              options.format + "\". For keypoints alone use \"2d_only\"");
  require_one_of(keypoints_3d, {"file", "body"}, where + ": keypoints_3d");
  require(body_model.empty() || options.role == Role::truth, where,
          "\"body_model\" checks the bodies that a file gives, so it needs \"role\": \"truth\"");
  require(keypoints_3d == "file" || !body_model.empty(), where,
          "\"keypoints_3d\": \"body\" needs a \"body_model\" to compute them");
  options.body_model = body_model;
  options.keypoints_3d_of_body = keypoints_3d == "body";
  options.root = root;
  options.annotations = annotations;
  options.images = images;
  options.curation = curation;
  return options;
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
    for (const char* path : {"root", "topology", "curation", "body_model"})
      resolve_path(dataset, path, folder);
  }
}

namespace {

LeakageConfig parse_leakage(const json& object, const std::string& where) {
  LeakageConfig leakage;
  JsonFields fields(object, where);
  if (const json* sets = fields.child("test_sets")) {
    leakage.test_sets = parse_datasets(*sets, where + ": test_sets");
  }
  fields.read("max_distance", leakage.max_distance);
  fields.finish();
  require(!leakage.test_sets.empty(), where, "\"test_sets\" must name at least one dataset");
  require(leakage.max_distance >= 0 && leakage.max_distance <= filters::kMaxHashDistance, where,
          fmt::format("\"max_distance\" must be 0 to {}", filters::kMaxHashDistance));
  return leakage;
}

void parse_network(const json& object, const std::string& where, NetworkConfig& network) {
  std::string checkpoint;
  std::string asset;
  JsonFields fields(object, where);
  fields.require("checkpoint", checkpoint);
  fields.require("smal_asset", asset);
  fields.read("device", network.device);
  fields.read("dtype", network.dtype);
  fields.read("batch", network.batch);
  fields.read("compute_threads", network.compute_threads);
  fields.finish();
  require_one_of(network.dtype, {"float32", "bfloat16"}, where + ": dtype");
  require(network.batch >= 1, where, fmt::format("\"batch\" must be at least 1, got {}", network.batch));
  require(network.compute_threads >= 0, where, "\"compute_threads\" must be 0 (all cores) or more");
  network.checkpoint = checkpoint;
  network.smal_asset = asset;
}

void parse_tta(const json& object, const std::string& where, TtaConfig& tta) {
  JsonFields fields(object, where);
  fields.read("objective", tta.objective);
  fields.read("learning_rate", tta.learning_rate);
  fields.read("aux_weight", tta.aux_weight);
  fields.read("reproj_weight", tta.reproj_weight);
  fields.read("iterations_min", tta.iterations_min);
  fields.read("iterations_max", tta.iterations_max);
  fields.read("batch", tta.batch);
  fields.finish();
  require_one_of(tta.objective, {"paper", "demo"}, where + ": objective");
  require(tta.learning_rate > 0, where, "\"learning_rate\" must be greater than 0");
  require(tta.iterations_min >= 1 && tta.iterations_min <= tta.iterations_max, where,
          fmt::format("expected 1 <= iterations_min <= iterations_max, got {} and {}", tta.iterations_min,
                      tta.iterations_max));
  require(tta.batch >= 1, where, "\"batch\" must be at least 1");
}

void require_both_taus(const std::optional<double>& tau_low, const std::optional<double>& tau_high,
                       const std::string& where) {
  require(
      tau_low.has_value() == tau_high.has_value(), where,
      "\"tau_low\" and \"tau_high\" belong together: give both, or neither and run `quadruped3d calibrate`");
}

// `names`: of the config's datasets.
void parse_dataset_thresholds(const json& object, const std::string& where,
                              const std::vector<std::string>& names, FilterConfig& filter) {
  require(object.is_object(), where, "expected a JSON object with a dataset's name for each key");
  for (const auto& [name, limits] : object.items()) {
    require_one_of(name, names, where);
    DatasetThresholds& own = filter.datasets[name];
    JsonFields fields(limits, where + ": " + name);
    fields.read("tau_low", own.tau_low);
    fields.read("tau_high", own.tau_high);
    fields.read("delta", own.delta);
    fields.finish();
    require_both_taus(own.tau_low, own.tau_high, fields.where());
  }
}

void parse_filter(const json& object, const std::string& where, const std::vector<std::string>& names,
                  FilterConfig& filter) {
  JsonFields fields(object, where);
  fields.read("tau_low", filter.tau_low);
  fields.read("tau_high", filter.tau_high);
  fields.read("delta", filter.delta);
  if (const json* datasets = fields.child("datasets")) {
    parse_dataset_thresholds(*datasets, where + ": datasets", names, filter);
  }
  fields.finish();
  require_both_taus(filter.tau_low, filter.tau_high, where);
}

void parse_guards(const json& object, const std::string& where, GuardConfig& guards) {
  std::string priors;
  JsonFields fields(object, where);
  fields.read("visible_min", guards.visible_min);
  fields.read("iterations_full_at", guards.iterations_full_at);
  fields.read("held_out_share", guards.held_out_share);
  fields.read("held_out_seed", guards.held_out_seed);
  fields.read("held_out_patience", guards.held_out_patience);
  fields.read("pose_deviation_max", guards.pose_deviation_max);
  fields.read("limb_factor_max", guards.limb_factor_max);
  fields.read("left_right_max", guards.left_right_max);
  fields.read("mask_iou_min", guards.mask_iou_min);
  fields.read("priors", priors);
  fields.finish();
  guards.priors = priors;
  try {
    filters::check(guards);
  } catch (const std::invalid_argument& error) {
    throw run::ConfigError(where + ": " + error.what());
  }
  require(guards.iterations_full_at >= 0 && guards.iterations_full_at <= manifests::kNumKeypoints, where,
          fmt::format("\"iterations_full_at\" must be 0 (off) to 26, got {}", guards.iterations_full_at));
  require(guards.held_out_share >= 0.0 && guards.held_out_share < 1.0, where,
          fmt::format("\"held_out_share\" must be 0 (off) or more and less than 1, got {}",
                      guards.held_out_share));
  require(guards.held_out_patience >= 0, where, "\"held_out_patience\" must be 0 (no limit) or more");
}

void parse_shards(const json& object, const std::string& where, ShardConfig& shards) {
  JsonFields fields(object, where);
  fields.read("unit_size", shards.unit_size);
  fields.read("images", shards.images);
  fields.read("jpeg_quality", shards.jpeg_quality);
  fields.read("crop_scale", shards.crop_scale);
  fields.read("crop_min_side_px", shards.crop_min_side_px);
  fields.finish();
  require_one_of(shards.images, {"jpeg", "png", "reference"}, where + ": images");
  require(shards.unit_size >= 1 && shards.unit_size <= 65536, where, "\"unit_size\" must be 1 to 65536");
  require(shards.jpeg_quality >= 1 && shards.jpeg_quality <= 100, where, "\"jpeg_quality\" must be 1 to 100");
  require(shards.crop_scale >= 1.0 && shards.crop_scale <= 4.0, where, "\"crop_scale\" must be 1 to 4");
  require(shards.crop_min_side_px >= 256 && shards.crop_min_side_px <= 2048, where,
          "\"crop_min_side_px\" must be 256 to 2048");
}

void parse_calibrate(const json& object, const std::string& where, CalibrateConfig& shares) {
  JsonFields fields(object, where);
  fields.read("retained", shares.retained);
  fields.read("refined", shares.refined);
  fields.read("per_dataset", shares.per_dataset);
  fields.finish();
  require(shares.retained > 0 && shares.refined > 0 && shares.retained + shares.refined < 1, where,
          "the shares must be greater than 0 and their sum less than 1");
}

void resolve_paths(json& config, const fs::path& folder) {
  if (config.contains("network")) {
    resolve_path(config["network"], "checkpoint", folder);
    resolve_path(config["network"], "smal_asset", folder);
  }
  if (config.contains("guards")) resolve_path(config["guards"], "priors", folder);
  resolve_path(config, "veto", folder);
  resolve_dataset_paths(config, "datasets", folder);
  if (config.contains("leakage")) resolve_dataset_paths(config["leakage"], "test_sets", folder);
}

// The config laid over its profile.
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
  for (const DatasetConfig& dataset : datasets) names.push_back(dataset.name);
  return names;
}

}  // namespace

BuildConfig parse_build_config(const json& merged, const std::string& where) {
  BuildConfig config;
  const json expanded = expand_profile(merged, where);
  JsonFields fields(expanded, where);
  fields.read("profile", config.profile);
  fields.read("name", config.name);
  fields.read("version", config.version);
  std::string veto;
  fields.read("veto", veto);
  config.veto = veto;
  if (const json* datasets = fields.child("datasets")) {
    config.datasets = parse_datasets(*datasets, where + ": datasets");
  }
  require(!config.datasets.empty(), where, "\"datasets\" must name at least one dataset");
  if (const json* network = fields.child("network")) {
    parse_network(*network, where + ": network", config.network);
  } else {
    require(!needs_network(config), where,
            "the key \"network\" is missing; a dataset of role \"pseudo\", the default, gets its labels from "
            "it. Datasets that bring theirs have the role \"truth\" or \"2d_only\"");
  }
  if (const json* tta = fields.child("tta")) parse_tta(*tta, where + ": tta", config.tta);
  if (const json* leakage = fields.child("leakage")) {
    config.leakage = parse_leakage(*leakage, where + ": leakage");
  }
  if (const json* filter = fields.child("filter")) {
    parse_filter(*filter, where + ": filter", names_of(config.datasets), config.filter);
  }
  if (const json* guards = fields.child("guards")) parse_guards(*guards, where + ": guards", config.guards);
  if (const json* shards = fields.child("shards")) parse_shards(*shards, where + ": shards", config.shards);
  if (const json* shares = fields.child("calibrate")) {
    parse_calibrate(*shares, where + ": calibrate", config.calibrate);
  }
  fields.finish();
  require(is_plain_name(config.name), where,
          "\"name\" becomes a folder's name: letters, digits, '.', '_' and '-' only");
  require(is_version(config.version), where,
          "\"version\" must look like 1.0.0, got \"" + config.version + "\"");
  std::set<std::string> seen;
  for (const auto& dataset : config.datasets) {
    require(seen.insert(dataset.name + "/" + dataset.split).second, where,
            "two datasets have the name and split " + dataset.name + "/" + dataset.split +
                "; sample ids would not be unique");
  }
  config.as_written = merged;
  return config;
}

BuildConfig load_build_config(const std::vector<fs::path>& files) {
  ConfigLayers layers = read_config_layers(files, resolve_paths);
  BuildConfig config = parse_build_config(layers.resolved, layers.where);
  config.as_written = std::move(layers.as_written);
  return config;
}

bool needs_network(const BuildConfig& config) {
  return std::any_of(config.datasets.begin(), config.datasets.end(),
                     [](const DatasetConfig& dataset) { return dataset.role == Role::pseudo; });
}

bool uses_priors(const GuardConfig& guards) {
  return guards.pose_deviation_max > 0.0 || guards.limb_factor_max > 0.0;
}

fs::path priors_file(const BuildConfig& config) {
  return config.guards.priors.empty() ? config.network.checkpoint : config.guards.priors;
}

}  // namespace q3d::pipeline::config
