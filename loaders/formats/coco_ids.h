// COCO's ids as keys. Tools write them as whole numbers (of up to 64 bits, also negative), as 1.0, or as
// texts.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <unordered_map>

namespace q3d::loaders::formats {

// A number and a text are different ids: 1 and "1" may both occur in a file.
struct CocoId {
  std::string text;  // the number in decimal, or the text itself
  bool is_text = false;

  std::string key() const { return is_text ? '"' + text + '"' : text; }
};

// Returns nothing if the value is no id: another type, an empty text, a fraction, or a number that double
// precision cannot tell from its neighbours.
std::optional<CocoId> coco_id(const nlohmann::json& value);
// Returns the id in a field of an object, or nothing if the object lacks it.
std::optional<CocoId> coco_id(const nlohmann::json& object, const char* field);
// Returns the id that a key of a JSON object stands for. Such a key is always a text.
CocoId coco_id_of_key(const std::string& key);

// A map from ids to values. If a file writes an id as a text in one place and as a number in another, the
// value is still found, unless two ids have that number ("7" and "07").
template <typename Value>
class CocoIdMap {
 public:
  // Returns false, and keeps the earlier value, if the id is there already.
  bool add(const CocoId& id, Value value);
  const Value* find(const CocoId& id);

  std::size_t size() const { return values_.size(); }
  // Returns how many values were found although the id was of the other type.
  std::size_t found_as_other_type() const { return found_as_other_type_; }
  // Returns one id of the map as an example for messages; empty if there is none.
  const std::string& example() const { return example_; }

 private:
  std::unordered_map<std::string, Value> values_;                              // by key()
  std::unordered_map<std::string, std::optional<std::string>> key_of_number_;  // nothing: ambiguous
  std::string example_;
  std::size_t found_as_other_type_ = 0;
};

// Returns the decimal number of an id without leading zeros; nothing if the id is no number.
std::optional<std::string> number_of(const CocoId& id);

template <typename Value>
bool CocoIdMap<Value>::add(const CocoId& id, Value value) {
  if (!values_.emplace(id.key(), std::move(value)).second) return false;
  if (example_.empty()) example_ = id.key();
  if (const auto number = number_of(id)) {
    const auto [found, is_new] = key_of_number_.emplace(*number, id.key());
    if (!is_new) found->second = std::nullopt;
  }
  return true;
}

template <typename Value>
const Value* CocoIdMap<Value>::find(const CocoId& id) {
  if (const auto found = values_.find(id.key()); found != values_.end()) return &found->second;
  const auto number = number_of(id);
  const auto key = number ? key_of_number_.find(*number) : key_of_number_.end();
  if (key == key_of_number_.end() || !key->second) return nullptr;
  ++found_as_other_type_;
  return &values_.at(*key->second);
}

}  // namespace q3d::loaders::formats
