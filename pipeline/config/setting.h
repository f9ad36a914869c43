// There is one table of settings for each config struct. A setting's key, member, range and description are
// written once; parsing, printing, stage keys, the JSON Schema and the tables of docs/config.md all use them.
#pragma once

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "pipeline/config/config_layers.h"
#include "pipeline/config/json_fields.h"

namespace q3d::pipeline::config {

// The results that a setting affects: those of a stage, or the weights of a training run. `elsewhere` means
// that it affects none, or that the code that makes the stage's key handles it.
enum class DecidedStage : std::uint8_t { elsewhere, predict, refine, shards, weights };

// A member that is written as a word, such as an enum. `set` is called with a word of the setting's list.
template <typename Struct>
struct Word {
  std::function<std::string(const Struct&)> get;
  std::function<void(Struct&, const std::string&)> set;
};

// The range of a number. An open end is not part of the range.
struct Range {
  std::optional<double> least{};
  std::optional<double> most{};
  bool is_open_below = false;
  bool is_open_above = false;

  bool holds(double value) const;
  std::string text() const;  // "at least 1", "greater than 0 and at most 1"; empty without an end
};

template <typename Struct>
struct Setting {
  using Member =
      std::variant<bool Struct::*, int Struct::*, std::uint64_t Struct::*, double Struct::*,
                   std::optional<double> Struct::*, std::optional<int> Struct::*, std::string Struct::*,
                   std::filesystem::path Struct::*, std::vector<std::string> Struct::*, Word<Struct>>;
  const char* key = nullptr;
  Member member;
  const char* description = nullptr;  // Markdown; a sentence or more, without the range and the default
  Range range{};
  std::vector<std::string> words{};  // allowed texts, also inside a list; empty allows any
  bool is_required = false;
  DecidedStage decides = DecidedStage::elsewhere;
};
template <typename Struct>
using Settings = std::vector<Setting<Struct>>;

// The facts about a setting that the schema and the page show; they do not depend on the setting's struct.
struct SettingFacts {
  std::string key;
  std::string type;              // type in JSON Schema: boolean, integer, number, string, array (of strings)
  nlohmann::ordered_json value;  // null if the default is absent or empty
  std::string description;
  Range range;
  std::vector<std::string> words;
  bool is_required = false;
};

// Throws ConfigError that names the key, what was found and what was expected.
void check_range(const Range& range, double value, const std::string& key, const std::string& where);

// Throws ConfigError unless the text, or each text of the list, is one of the words.
void check_words(const std::vector<std::string>& words, const nlohmann::ordered_json& value,
                 const std::string& where);

// Returns the value as a config file writes it; null for an absent number, an empty path and an empty list.
template <typename Struct>
nlohmann::ordered_json value_of(const Setting<Struct>& setting, const Struct& config) {
  return std::visit(
      [&](const auto& member) -> nlohmann::ordered_json {
        using Member = std::decay_t<decltype(member)>;
        if constexpr (std::is_same_v<Member, Word<Struct>>) {
          return member.get(config);
        } else if constexpr (std::is_same_v<Member, std::filesystem::path Struct::*>) {
          const std::filesystem::path& path = config.*member;
          return path.empty() ? nlohmann::ordered_json() : nlohmann::ordered_json(path.string());
        } else if constexpr (std::is_same_v<Member, std::vector<std::string> Struct::*>) {
          const std::vector<std::string>& texts = config.*member;
          return texts.empty() ? nlohmann::ordered_json() : nlohmann::ordered_json(texts);
        } else if constexpr (std::is_same_v<Member, std::optional<double> Struct::*> ||
                             std::is_same_v<Member, std::optional<int> Struct::*>) {
          const auto& number = config.*member;
          return number ? nlohmann::ordered_json(*number) : nlohmann::ordered_json();
        } else {
          return config.*member;
        }
      },
      setting.member);
}

// Reads one setting; an absent key keeps the struct's default. Throws ConfigError.
template <typename Struct>
void read_setting(JsonFields& fields, const Setting<Struct>& setting, Struct& config) {
  const bool is_there = fields.child(setting.key) != nullptr;
  if (!is_there && setting.is_required) fields.fail_missing(setting.key);
  if (!is_there) return;
  std::visit(
      [&](const auto& member) {
        using Member = std::decay_t<decltype(member)>;
        if constexpr (std::is_same_v<Member, Word<Struct>>) {
          std::string word;
          fields.read(setting.key, word);
          require_one_of(word, setting.words, fields.where() + ": " + setting.key);
          member.set(config, word);
        } else {
          fields.read(setting.key, config.*member);
        }
      },
      setting.member);
  const nlohmann::ordered_json value = value_of(setting, config);
  if (value.is_number()) check_range(setting.range, value.get<double>(), setting.key, fields.where());
  if (!setting.words.empty()) check_words(setting.words, value, fields.where() + ": " + setting.key);
}

// Reads every setting of the table. Throws ConfigError.
template <typename Struct>
void read_settings(JsonFields& fields, const Settings<Struct>& settings, Struct& config) {
  for (const Setting<Struct>& setting : settings) read_setting(fields, setting, config);
}

// Returns the effective values in the order of the table, without absent ones.
template <typename Struct>
nlohmann::ordered_json show_settings(const Settings<Struct>& settings, const Struct& config) {
  nlohmann::ordered_json object = nlohmann::ordered_json::object();
  for (const Setting<Struct>& setting : settings) {
    nlohmann::ordered_json value = value_of(setting, config);
    if (!value.is_null()) object[setting.key] = std::move(value);
  }
  return object;
}

// Returns the effective values that affect a stage's results. They are the config's part of the stage's key.
template <typename Struct>
nlohmann::json key_parts(const Settings<Struct>& settings, const Struct& config, DecidedStage stage) {
  nlohmann::json parts = nlohmann::json::object();
  for (const Setting<Struct>& setting : settings) {
    if (setting.decides == stage) parts[setting.key] = value_of(setting, config);
  }
  return parts;
}

template <typename Struct>
std::vector<SettingFacts> facts_of(const Settings<Struct>& settings) {
  std::vector<SettingFacts> facts;
  for (const Setting<Struct>& setting : settings) {
    SettingFacts& fact = facts.emplace_back();
    fact.key = setting.key;
    fact.type = std::visit(
        [](const auto& member) {
          using Member = std::decay_t<decltype(member)>;
          if constexpr (std::is_same_v<Member, bool Struct::*>) return "boolean";
          if constexpr (std::is_same_v<Member, int Struct::*> ||
                        std::is_same_v<Member, std::optional<int> Struct::*> ||
                        std::is_same_v<Member, std::uint64_t Struct::*>) {
            return "integer";
          }
          if constexpr (std::is_same_v<Member, double Struct::*> ||
                        std::is_same_v<Member, std::optional<double> Struct::*>) {
            return "number";
          }
          if constexpr (std::is_same_v<Member, std::vector<std::string> Struct::*>) return "array";
          return "string";
        },
        setting.member);
    fact.value = value_of(setting, Struct{});
    const bool is_text = fact.value.is_string();
    if (fact.value == (is_text ? nlohmann::ordered_json("") : nlohmann::ordered_json::array()))
      fact.value = nullptr;
    fact.description = setting.description;
    fact.range = setting.range;
    fact.words = setting.words;
    fact.is_required = setting.is_required;
  }
  return facts;
}

}  // namespace q3d::pipeline::config
