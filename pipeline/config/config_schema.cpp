#include "pipeline/config/config_schema.h"

#include "pipeline/config/build_settings.h"
#include "pipeline/config/setting_schema.h"

namespace q3d::pipeline::config {
namespace {

using nlohmann::ordered_json;

ordered_json datasets_schema() {
  std::vector<SettingFacts> settings = facts_of(dataset_settings());
  for (SettingFacts facts : facts_of(own_label_settings())) {
    facts.is_required = false;  // depends on the format; the program checks it
    settings.push_back(std::move(facts));
  }
  return {{"type", "array"}, {"items", whole_object_schema(settings)}};
}

ordered_json filter_schema() {
  ordered_json schema = object_schema(facts_of(filter_settings()));
  schema["properties"]["datasets"] = {
      {"description", "thresholds of single datasets, by their name"},
      {"type", "object"},
      {"additionalProperties", object_schema(facts_of(dataset_threshold_settings()))}};
  return schema;
}

ordered_json leakage_schema() {
  ordered_json schema = object_schema(facts_of(leakage_settings()));
  schema["properties"]["test_sets"] = datasets_schema();
  return schema;
}

}  // namespace

ordered_json build_config_schema() {
  ordered_json schema = object_schema(facts_of(build_settings()));
  ordered_json& properties = schema["properties"];
  properties["datasets"] = datasets_schema();
  properties["network"] = object_schema(facts_of(network_settings()));
  properties["tta"] = object_schema(facts_of(tta_settings()));
  properties["filter"] = filter_schema();
  properties["guards"] = object_schema(facts_of(guard_settings()));
  properties["shards"] = object_schema(facts_of(shard_settings()));
  properties["leakage"] = leakage_schema();
  properties["calibrate"] = object_schema(facts_of(calibrate_settings()));
  return schema_document("A build's config of quadruped3d", schema);
}

}  // namespace q3d::pipeline::config
