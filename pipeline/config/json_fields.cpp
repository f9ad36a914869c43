#include "pipeline/config/json_fields.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace q3d::pipeline::config {

// Levenshtein distance, one row at a time.
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row.back();
}

bool is_misspelling(const std::string& a, const std::string& b) {
  return 3 * edit_distance(a, b) <= std::max(a.size(), b.size());
}

std::string nearest_word(const std::string& word, const std::vector<std::string>& candidates) {
  const auto nearest = std::min_element(
      candidates.begin(), candidates.end(),
      [&](const auto& a, const auto& b) { return edit_distance(word, a) < edit_distance(word, b); });
  return nearest == candidates.end() ? std::string() : *nearest;
}

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
                            nearest_word(key, {known_.begin(), known_.end()}));
  }
  if (!problems.empty()) throw run::ConfigError(where_ + ": " + problems);
}

void JsonFields::fail_missing(const std::string& key) const {
  std::string hint;
  for (const auto& [other, value] : object_.items()) {
    if (other != key && known_.count(other) == 0 && is_misspelling(key, other)) {
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
