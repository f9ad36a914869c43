#include "pipeline/config/setting_schema.h"

namespace q3d::pipeline::config {
namespace {

using nlohmann::ordered_json;

ordered_json schema_of(const SettingFacts& facts) {
  ordered_json schema{{"description", facts.description}, {"type", facts.type}};
  const bool is_list = facts.type == "array";
  if (is_list) {
    schema["items"] = {{"type", "string"}};
    schema["minItems"] = 1;
  }
  if (!facts.words.empty()) (is_list ? schema["items"] : schema)["enum"] = facts.words;
  if (facts.range.least) {
    schema[facts.range.is_open_below ? "exclusiveMinimum" : "minimum"] = *facts.range.least;
  }
  if (facts.range.most) {
    schema[facts.range.is_open_above ? "exclusiveMaximum" : "maximum"] = *facts.range.most;
  }
  if (!facts.value.is_null()) schema["default"] = facts.value;
  return schema;
}

}  // namespace

ordered_json object_schema(const std::vector<SettingFacts>& settings) {
  ordered_json schema{
      {"type", "object"}, {"properties", ordered_json::object()}, {"additionalProperties", false}};
  for (const SettingFacts& facts : settings) schema["properties"][facts.key] = schema_of(facts);
  return schema;
}

ordered_json whole_object_schema(const std::vector<SettingFacts>& settings) {
  ordered_json schema = object_schema(settings);
  for (const SettingFacts& facts : settings) {
    if (facts.is_required) schema["required"].push_back(facts.key);
  }
  return schema;
}

ordered_json schema_document(const std::string& title, const ordered_json& object) {
  ordered_json document{{"$schema", "https://json-schema.org/draft/2020-12/schema"}, {"title", title}};
  document.update(object);
  return document;
}

}  // namespace q3d::pipeline::config
