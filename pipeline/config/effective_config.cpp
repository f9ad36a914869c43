#include "pipeline/config/effective_config.h"

namespace q3d::pipeline::config {
namespace {

using nlohmann::ordered_json;

ordered_json dataset_json(const DatasetConfig& dataset) {
  ordered_json object = {{"name", dataset.name},          {"format", dataset.format},
                         {"root", dataset.root.string()}, {"annotations", dataset.annotations.string()},
                         {"split", dataset.split},        {"role", to_string(dataset.role)}};
  if (!dataset.images.empty()) object["images"] = dataset.images.string();
  if (!dataset.curation.empty()) object["curation"] = dataset.curation.string();
  if (!dataset.body_model.empty()) {
    object["body_model"] = dataset.body_model.string();
    object["keypoints_3d"] = dataset.keypoints_3d_of_body ? "body" : "file";
  }
  if (dataset.topology.empty()) return object;
  object["topology"] = dataset.topology.string();
  object["species"] = dataset.species;
  object["min_confidence"] = dataset.min_confidence;
  object["box_margin"] = dataset.box_margin;
  return object;
}

ordered_json datasets_json(const std::vector<DatasetConfig>& datasets) {
  ordered_json list = ordered_json::array();
  for (const DatasetConfig& dataset : datasets) list.push_back(dataset_json(dataset));
  return list;
}

ordered_json network_json(const NetworkConfig& network) {
  return {{"checkpoint", network.checkpoint.string()},
          {"smal_asset", network.smal_asset.string()},
          {"device", network.device},
          {"dtype", network.dtype},
          {"batch", network.batch},
          {"compute_threads", network.compute_threads}};
}

ordered_json tta_json(const TtaConfig& tta) {
  return {{"objective", tta.objective},
          {"learning_rate", tta.learning_rate},
          {"aux_weight", tta.aux_weight},
          {"reproj_weight", tta.reproj_weight},
          {"iterations_min", tta.iterations_min},
          {"iterations_max", tta.iterations_max},
          {"batch", tta.batch}};
}

ordered_json filter_json(const FilterConfig& filter) {
  ordered_json object = ordered_json::object();
  const auto add = [](ordered_json& into, const char* key, const std::optional<double>& value) {
    if (value) into[key] = *value;
  };
  add(object, "tau_low", filter.tau_low);
  add(object, "tau_high", filter.tau_high);
  object["delta"] = filter.delta;
  for (const auto& [name, limits] : filter.datasets) {
    ordered_json& own = object["datasets"][name] = ordered_json::object();
    add(own, "tau_low", limits.tau_low);
    add(own, "tau_high", limits.tau_high);
    add(own, "delta", limits.delta);
  }
  return object;
}

}  // namespace

ordered_json effective_guards(const GuardConfig& guards) {
  ordered_json object = {{"visible_min", guards.visible_min},
                         {"iterations_full_at", guards.iterations_full_at},
                         {"held_out_share", guards.held_out_share},
                         {"held_out_seed", guards.held_out_seed},
                         {"held_out_patience", guards.held_out_patience},
                         {"pose_deviation_max", guards.pose_deviation_max},
                         {"limb_factor_max", guards.limb_factor_max},
                         {"left_right_max", guards.left_right_max},
                         {"mask_iou_min", guards.mask_iou_min}};
  if (!guards.priors.empty()) object["priors"] = guards.priors.string();
  return object;
}

ordered_json effective_config(const BuildConfig& config) {
  ordered_json object = {{"name", config.name},
                         {"version", config.version},
                         {"profile", config.profile},
                         {"datasets", datasets_json(config.datasets)}};
  if (!config.veto.empty()) object["veto"] = config.veto.string();
  if (config.leakage) {
    object["leakage"] = {{"test_sets", datasets_json(config.leakage->test_sets)},
                         {"max_distance", config.leakage->max_distance}};
  }
  if (!config.network.checkpoint.empty()) object["network"] = network_json(config.network);
  object["tta"] = tta_json(config.tta);
  object["filter"] = filter_json(config.filter);
  object["guards"] = effective_guards(config.guards);
  object["shards"] = {{"unit_size", config.shards.unit_size},
                      {"images", config.shards.images},
                      {"jpeg_quality", config.shards.jpeg_quality},
                      {"crop_scale", config.shards.crop_scale},
                      {"crop_min_side_px", config.shards.crop_min_side_px}};
  object["calibrate"] = {{"retained", config.calibrate.retained},
                         {"refined", config.calibrate.refined},
                         {"per_dataset", config.calibrate.per_dataset}};
  return object;
}

}  // namespace q3d::pipeline::config
