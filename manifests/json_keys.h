// Refuses JSON objects that give one key twice. JSON parsers silently take the last value, or the first, so
// two readers of such a file may see different contents.
#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace q3d::manifests {

class RepeatedKey : public std::runtime_error {
 public:
  explicit RepeatedKey(const std::string& key)
      : std::runtime_error(
            "the key " + nlohmann::json(key).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) +
            " stands twice in one object, expected once") {}
};

// Returns a callback for Json::parse that throws RepeatedKey at the second key of a name in one object, and
// otherwise calls `next`, if there is one. `Json` is nlohmann::json or nlohmann::ordered_json.
template <typename Json>
typename Json::parser_callback_t refuse_repeated_keys(typename Json::parser_callback_t next = nullptr) {
  using Event = typename Json::parse_event_t;
  // There is one set of keys for each open object. The vector is shared, because std::function copies what it
  // holds.
  const auto open = std::make_shared<std::vector<std::set<std::string>>>();
  return [open, next = std::move(next)](int depth, Event event, Json& parsed) {
    if (event == Event::object_start) open->emplace_back();
    if (event == Event::object_end) open->pop_back();
    if (event == Event::key) {
      const auto& key = parsed.template get_ref<const std::string&>();
      if (!open->back().insert(key).second) throw RepeatedKey(key);
    }
    return next ? next(depth, event, parsed) : true;
  };
}

}  // namespace q3d::manifests
