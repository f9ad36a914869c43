#include "pipeline/config/config_override.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <utility>

#include "manifests/spelling.h"
#include "pipeline/config/json_depth.h"
#include "pipeline/run/errors.h"
#include "pipeline/run/words.h"

namespace q3d::pipeline::config {
namespace {

using nlohmann::json;

constexpr const char* kExample = "expected KEY=VALUE, such as tta.learning_rate=2e-6";

[[noreturn]] void fail(const ConfigOverride& given, const std::string& what) {
  throw run::ConfigError(fmt::format("--set {}: {}", given.text, what));
}

std::vector<std::string> parted(std::string_view keys) {
  const bool is_slashed = keys.front() == '/';
  if (is_slashed) keys.remove_prefix(1);
  std::vector<std::string> parts;
  while (true) {
    const std::size_t end = keys.find(is_slashed ? '/' : '.');
    parts.emplace_back(keys.substr(0, end));
    if (end == std::string_view::npos) return parts;
    keys.remove_prefix(end + 1);
  }
}

json value_of_text(const std::string& text) {
  try {
    return json::parse(text, refuse_depth("--set"));
  } catch (const json::exception&) {
    return text;
  }
}

std::optional<std::size_t> as_place(const std::string& key) {
  std::size_t place = 0;
  const char* end = key.data() + key.size();
  const auto [stop, error] = std::from_chars(key.data(), end, place);
  return error == std::errc() && stop == end ? std::optional(place) : std::nullopt;
}

// Returns the place of the member that `key` names in the list.
std::size_t place_in(const json& list, const std::string& key, const ConfigOverride& given) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (!list[i].is_object() || !list[i].contains("name") || !list[i]["name"].is_string()) continue;
    names.push_back(list[i]["name"].get<std::string>());
    if (names.back() == key) return i;
  }
  const auto place = as_place(key);
  if (place && *place < list.size()) return *place;
  fail(given, fmt::format("the list has {}, and \"{}\" is neither the place of one, counted from 0, nor its "
                          "\"name\"{}",
                          run::counted(static_cast<std::int64_t>(list.size()), "entry", "entries"), key,
                          manifests::suggestion(key, names)));
}

// Returns the keys with places for members of lists, as a JSON pointer into the config.
json::json_pointer pointer_into(const json& config, const ConfigOverride& given) {
  json::json_pointer pointer;
  const json* here = &config;
  for (const std::string& key : given.keys) {
    if (here != nullptr && here->is_array()) {
      const std::size_t place = place_in(*here, key, given);
      pointer.push_back(std::to_string(place));
      here = &(*here)[place];
      continue;
    }
    if (here != nullptr && !here->is_object() && !here->is_null()) {
      fail(given, fmt::format("\"{}\" leads into {}, which holds no keys", key, here->dump()));
    }
    pointer.push_back(key);
    const bool is_there = here != nullptr && here->is_object() && here->contains(key);
    here = is_there ? &(*here)[key] : nullptr;
  }
  return pointer;
}

// Returns a config that holds the value alone, with empty objects before it in lists, and with its paths
// resolved.
json layer_of(const json::json_pointer& pointer, const json& config, const json& value) {
  if (pointer.empty()) return value;
  const json::json_pointer parent = pointer.parent_pointer();
  const bool is_in_list = config.contains(parent) && config[parent].is_array();
  json container;
  if (is_in_list) {
    const std::size_t place = *as_place(pointer.back());
    container = json(place, json::object());
    container.push_back(value);
  } else {
    container[pointer.back()] = value;
  }
  return layer_of(parent, config, container);
}

// Returns the value of the key in what holds it. Makes objects that are missing.
json& member(json& holder, const std::string& key) {
  return holder.is_array() ? holder[*as_place(key)] : holder[key];
}

void put(const json::json_pointer& pointer, const json& value, json& config) {
  std::vector<std::string> keys;
  for (json::json_pointer rest = pointer; !rest.empty(); rest.pop_back()) {
    keys.insert(keys.begin(), rest.back());
  }
  json* holder = &config;
  for (std::size_t i = 0; i + 1 < keys.size(); ++i) holder = &member(*holder, keys[i]);
  if (!value.is_null()) {
    member(*holder, keys.back()).merge_patch(value);
  } else if (holder->is_array()) {
    holder->erase(*as_place(keys.back()));
  } else if (holder->is_object()) {
    holder->erase(keys.back());
  }
}

}  // namespace

ConfigOverride parse_override(const std::string& text) {
  const std::size_t equals = text.find('=');
  ConfigOverride given{text, {}, {}};
  if (equals == std::string::npos || equals == 0) fail(given, kExample);
  given.keys = parted(std::string_view(text).substr(0, equals));
  if (std::find(given.keys.begin(), given.keys.end(), "") != given.keys.end()) {
    fail(given, fmt::format("a part of the key is empty; {}", kExample));
  }
  given.value = value_of_text(text.substr(equals + 1));
  return given;
}

void apply_override(
    const ConfigOverride& given,
    const std::function<void(json& layer, const std::filesystem::path& folder)>& resolve_paths,
    const std::filesystem::path& folder, json& resolved, json& as_written) {
  const json::json_pointer pointer = pointer_into(resolved, given);
  json layer = layer_of(pointer, resolved, given.value);
  if (!given.value.is_null()) resolve_paths(layer, folder);
  put(pointer, given.value.is_null() ? json() : layer[pointer], resolved);
  put(pointer, given.value, as_written);
}

}  // namespace q3d::pipeline::config
