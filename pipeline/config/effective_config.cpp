#include "pipeline/config/effective_config.h"

#include "pipeline/config/build_settings.h"

namespace q3d::pipeline::config {
namespace {

using nlohmann::ordered_json;

ordered_json dataset_json(const DatasetConfig& dataset) {
  ordered_json object = show_settings(dataset_settings(), dataset);
  if (dataset.body_model.empty()) object.erase("keypoints_3d");
  if (!dataset.topology.empty()) object.update(show_settings(own_label_settings(), dataset));
  return object;
}

ordered_json datasets_json(const std::vector<DatasetConfig>& datasets) {
  ordered_json list = ordered_json::array();
  for (const DatasetConfig& dataset : datasets) list.push_back(dataset_json(dataset));
  return list;
}

ordered_json filter_json(const FilterConfig& filter) {
  ordered_json object = show_settings(filter_settings(), filter);
  for (const auto& [name, limits] : filter.datasets) {
    object["datasets"][name] = show_settings(dataset_threshold_settings(), limits);
  }
  return object;
}

}  // namespace

ordered_json effective_guards(const GuardConfig& guards) {
  return show_settings(guard_settings(), guards);
}

ordered_json effective_config(const BuildConfig& config) {
  ordered_json object = show_settings(build_settings(), config);
  object["datasets"] = datasets_json(config.datasets);
  if (config.leakage) {
    object["leakage"] = show_settings(leakage_settings(), *config.leakage);
    object["leakage"]["test_sets"] = datasets_json(config.leakage->test_sets);
  }
  if (!config.network.checkpoint.empty())
    object["network"] = show_settings(network_settings(), config.network);
  object["tta"] = show_settings(tta_settings(), config.tta);
  object["filter"] = filter_json(config.filter);
  object["guards"] = effective_guards(config.guards);
  object["shards"] = show_settings(shard_settings(), config.shards);
  object["calibrate"] = show_settings(calibrate_settings(), config.calibrate);
  return object;
}

}  // namespace q3d::pipeline::config
