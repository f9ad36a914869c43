#include "pipeline/training/settings/training_schema.h"

#include "pipeline/config/setting_schema.h"
#include "pipeline/training/settings/training_settings.h"

namespace q3d::pipeline::training::settings {
namespace {

using config::facts_of;
using nlohmann::ordered_json;

ordered_json any_names(const ordered_json& values) {
  return {{"type", "object"}, {"minProperties", 1}, {"additionalProperties", values}};
}

ordered_json stages_schema() {
  return any_names({{"type", "array"},
                    {"minItems", 1},
                    {"items", config::whole_object_schema(facts_of(phase_settings()))}});
}

}  // namespace

ordered_json training_config_schema() {
  std::vector<config::SettingFacts> top = facts_of(feed_settings());
  for (config::SettingFacts facts : facts_of(training_settings())) top.push_back(std::move(facts));
  ordered_json schema = config::object_schema(top);
  ordered_json& properties = schema["properties"];
  properties["network"] = config::object_schema(facts_of(training_network_settings()));
  properties["pools"] = any_names(config::whole_object_schema(facts_of(pool_settings())));
  properties["stages"] = stages_schema();
  properties["augmentation"] = config::object_schema(facts_of(augmentation_settings()));
  properties["domain"] = config::object_schema(facts_of(domain_settings()));
  properties["loss_weights"] = config::object_schema(facts_of(loss_weight_settings()));
  return config::schema_document("A training config of quadruped3d", schema);
}

}  // namespace q3d::pipeline::training::settings
