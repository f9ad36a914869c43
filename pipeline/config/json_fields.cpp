#include "pipeline/config/json_fields.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "manifests/spelling.h"

namespace q3d::pipeline::config {

JsonFields::JsonFields(const nlohmann::json& object, std::string where)
    : object_(object), where_(std::move(where)) {
  if (!object_.is_object()) {
    throw run::ConfigError(fmt::format("{}: expected a JSON object, got {}", where_, object_.type_name()));
  }
}

const nlohmann::json* JsonFields::find(const std::string& key) {
  known_.insert(key);
  const auto found = object_.find(key);
  return found == object_.end() ? nullptr : &*found;
}

void JsonFields::finish() const {
  std::string problems;
  for (const auto& [key, value] : object_.items()) {
    if (known_.count(key) != 0) continue;
    problems += fmt::format("{}unknown key \"{}\"; did you mean \"{}\"?", problems.empty() ? "" : " ", key,
                            manifests::nearest_word(key, {known_.begin(), known_.end()}));
  }
  if (!problems.empty()) throw run::ConfigError(where_ + ": " + problems);
}

void JsonFields::fail_missing(const std::string& key) const {
  std::string hint;
  for (const auto& [other, value] : object_.items()) {
    if (other != key && known_.count(other) == 0 && manifests::is_misspelling(key, other)) {
      hint = fmt::format("; \"{}\" is not known: did you mean \"{}\"?", other, key);
    }
  }
  throw run::ConfigError(fmt::format("{}: the key \"{}\" is missing{}", where_, key, hint));
}

void JsonFields::fail(const std::string& key, const nlohmann::json& json, const char* expected) const {
  std::string got = json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  if (got.size() > 80) got = got.substr(0, 77) + "...";
  throw run::ConfigError(fmt::format("{}: \"{}\" must be {}, got {}", where_, key, expected, got));
}

void JsonFields::assign(const std::string& key, const nlohmann::json& json, std::string& value) const {
  if (!json.is_string()) fail(key, json, "a string");
  value = json.get<std::string>();
}

void JsonFields::assign(const std::string& key, const nlohmann::json& json,
                        std::filesystem::path& value) const {
  std::string text;
  assign(key, json, text);
  value = text;
}

void JsonFields::assign(const std::string& key, const nlohmann::json& json, bool& value) const {
  if (!json.is_boolean()) fail(key, json, "true or false");
  value = json.get<bool>();
}

void JsonFields::assign(const std::string& key, const nlohmann::json& json, int& value) const {
  if (!json.is_number_integer()) fail(key, json, "a whole number");
  const double wide = json.get<double>();
  if (std::abs(wide) > std::numeric_limits<int>::max()) fail(key, json, "a whole number of at most 31 bits");
  value = json.get<int>();
}

void JsonFields::assign(const std::string& key, const nlohmann::json& json, std::uint64_t& value) const {
  if (!json.is_number_unsigned()) fail(key, json, "a whole number, 0 or more");
  value = json.get<std::uint64_t>();
}

void JsonFields::assign(const std::string& key, const nlohmann::json& json, double& value) const {
  if (!json.is_number()) fail(key, json, "a number");
  value = json.get<double>();
}

void JsonFields::assign(const std::string& key, const nlohmann::json& json,
                        std::vector<std::string>& value) const {
  const char* const expected = "a list of strings with at least one";
  if (!json.is_array() || json.empty()) fail(key, json, expected);
  value.clear();
  for (const nlohmann::json& text : json) {
    if (!text.is_string()) fail(key, json, expected);
    value.push_back(text.get<std::string>());
  }
}

}  // namespace q3d::pipeline::config
