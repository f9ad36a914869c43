// Builds JSON documents from the events of nlohmann's parser. The library's own builder with a callback
// searches a list from its beginning after every object in it, so its time grows with the square of the
// list's length.
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "manifests/json_keys.h"

namespace q3d::manifests {

class TooDeep : public std::runtime_error {
 public:
  explicit TooDeep(int levels)
      : std::runtime_error(fmt::format(
            "it has objects or lists within each other beyond {} levels, expected at most that", levels)) {}
};

// This is far deeper than any file of this program or of the tools whose files it reads.
inline constexpr int kMaxJsonDepth = 256;

// A handler for Json::sax_parse. Its functions throw TooDeep beyond kMaxJsonDepth levels, RepeatedKey at the
// second key of a name in one object, and Json::exception if the text is no JSON.
template <typename Json>
class JsonBuilder {
 public:
  JsonBuilder() = default;
  // Gives `take` every element of the array `list` of the top-level object, and leaves that array empty.
  JsonBuilder(std::string list, std::function<void(Json&&)> take)
      : list_(std::move(list)), take_(std::move(take)) {}

  Json document() { return std::move(document_); }

  bool null() { return add(nullptr); }
  bool boolean(bool value) { return add(value); }
  bool number_integer(std::int64_t value) { return add(value); }
  bool number_unsigned(std::uint64_t value) { return add(value); }
  bool number_float(double value, const std::string& /*text*/) { return add(value); }
  bool string(std::string& value) { return add(std::move(value)); }
  bool binary(typename Json::binary_t& value) { return add(std::move(value)); }
  bool start_object(std::size_t /*elements*/) { return open(Json::value_t::object); }
  bool end_object() { return close(); }
  bool start_array(std::size_t /*elements*/) { return open(Json::value_t::array); }
  bool end_array() { return close(); }

  bool key(std::string& name) {
    require_depth();
    const auto [member, is_new] = open_.back()->emplace(name, nullptr);
    if (!is_new) throw RepeatedKey(name);
    member_ = &*member;
    if (open_.size() == 1) is_list_ = take_ && name == list_;
    return true;
  }

  template <typename Exception>
  bool parse_error(std::size_t /*position*/, const std::string& /*token*/, const Exception& error) {
    throw error;
  }

 private:
  void require_depth() const {
    if (open_.size() > static_cast<std::size_t>(kMaxJsonDepth)) throw TooDeep(kMaxJsonDepth);
  }
  bool is_in_list() const { return is_list_ && open_.size() == 2 && open_.back()->is_array(); }

  // Returns the place of the next value.
  Json& place() {
    if (open_.empty()) return document_;
    if (is_in_list()) return element_;
    if (!open_.back()->is_array()) return *member_;
    return open_.back()->emplace_back(nullptr);
  }

  template <typename Value>
  bool add(Value&& value) {
    require_depth();
    const bool is_element = is_in_list();
    place() = std::forward<Value>(value);
    if (is_element) give();
    return true;
  }

  bool open(typename Json::value_t type) {
    require_depth();
    Json& value = place();
    value = Json(type);
    open_.push_back(&value);
    return true;
  }

  bool close() {
    open_.pop_back();
    if (is_in_list()) give();
    return true;
  }

  void give() {
    take_(std::move(element_));
    element_ = nullptr;
  }

  std::string list_;
  std::function<void(Json&&)> take_;
  Json document_;
  Json element_;             // the current element of the list
  std::vector<Json*> open_;  // objects and arrays around the next value
  Json* member_ = nullptr;   // value of the last key of the innermost object
  bool is_list_ = false;     // the last key of the top-level object was that of the list
};

}  // namespace q3d::manifests
