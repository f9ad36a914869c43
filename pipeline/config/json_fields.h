// Strict reading of one JSON object into a struct: every key must be known, every type must fit.
#pragma once

#include <nlohmann/json.hpp>

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "pipeline/run/errors.h"

namespace q3d::pipeline::config {

// Reads the fields of `object`; `where` names it in messages ("config.json: filter"). Fields that are absent
// keep the caller's default. finish() throws ConfigError for a key that no read() asked for, naming the
// nearest one.
class JsonFields {
 public:
  JsonFields(const nlohmann::json& object, std::string where);

  template <typename T>
  void read(const std::string& key, T& value) {
    if (const nlohmann::json* found = find(key)) assign(key, *found, value);
  }
  template <typename T>
  void read(const std::string& key, std::optional<T>& value) {
    if (const nlohmann::json* found = find(key)) {
      T present{};
      assign(key, *found, present);
      value = std::move(present);
    }
  }
  template <typename T>
  void require(const std::string& key, T& value) {
    const nlohmann::json* found = find(key);
    if (found == nullptr) throw run::ConfigError(where_ + ": the key \"" + key + "\" is missing");
    assign(key, *found, value);
  }
  // The object or array under `key`, or null when it is absent.
  const nlohmann::json* child(const std::string& key) { return find(key); }
  void finish() const;
  const std::string& where() const { return where_; }

 private:
  const nlohmann::json* find(const std::string& key);
  void assign(const std::string& key, const nlohmann::json& json, std::string& value) const;
  void assign(const std::string& key, const nlohmann::json& json, bool& value) const;
  void assign(const std::string& key, const nlohmann::json& json, int& value) const;
  void assign(const std::string& key, const nlohmann::json& json, std::uint64_t& value) const;
  void assign(const std::string& key, const nlohmann::json& json, double& value) const;
  [[noreturn]] void fail(const std::string& key, const nlohmann::json& json, const char* expected) const;

  const nlohmann::json& object_;
  std::string where_;
  std::set<std::string> known_;
};

// The candidate with the least edit distance to `word`; empty when there is none.
std::string nearest_word(const std::string& word, const std::vector<std::string>& candidates);

}  // namespace q3d::pipeline::config
