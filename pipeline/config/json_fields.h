// Reads one JSON object strictly into a struct: every key must be known and every type must fit.
#pragma once

#include <nlohmann/json.hpp>

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "pipeline/run/errors.h"

namespace q3d::pipeline::config {

// Reads the fields of `object`; `where` names it in messages ("config.json: filter"). Fields that are absent
// keep the caller's default. finish() throws ConfigError that lists every key that no read() asked for, each
// with the nearest known one.
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
    if (found == nullptr) fail_missing(key);
    assign(key, *found, value);
  }
  // Returns the object or array under `key`, or null if it is absent.
  const nlohmann::json* child(const std::string& key) { return find(key); }
  void finish() const;
  // Throws ConfigError that names the key, and the unknown key that is probably meant to be it.
  [[noreturn]] void fail_missing(const std::string& key) const;
  const std::string& where() const { return where_; }

 private:
  const nlohmann::json* find(const std::string& key);
  void assign(const std::string& key, const nlohmann::json& json, std::string& value) const;
  void assign(const std::string& key, const nlohmann::json& json, std::filesystem::path& value) const;
  void assign(const std::string& key, const nlohmann::json& json, bool& value) const;
  void assign(const std::string& key, const nlohmann::json& json, int& value) const;
  void assign(const std::string& key, const nlohmann::json& json, std::uint64_t& value) const;
  void assign(const std::string& key, const nlohmann::json& json, double& value) const;
  void assign(const std::string& key, const nlohmann::json& json, std::vector<std::string>& value) const;
  [[noreturn]] void fail(const std::string& key, const nlohmann::json& json, const char* expected) const;

  const nlohmann::json& object_;
  std::string where_;
  std::set<std::string> known_;
};

}  // namespace q3d::pipeline::config
