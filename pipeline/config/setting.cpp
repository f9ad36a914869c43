#include "pipeline/config/setting.h"

namespace q3d::pipeline::config {

bool Range::holds(double value) const {
  if (least && (is_open_below ? !(value > *least) : !(value >= *least))) return false;
  return !most || (is_open_above ? value < *most : value <= *most);
}

std::string Range::text() const {
  std::string words;
  if (least && most && !is_open_below && !is_open_above) return fmt::format("{} to {}", *least, *most);
  if (least) words = fmt::format("{} {}", is_open_below ? "greater than" : "at least", *least);
  if (most) {
    words +=
        fmt::format("{}{} {}", words.empty() ? "" : " and ", is_open_above ? "less than" : "at most", *most);
  }
  return words;
}

void check_range(const Range& range, double value, const std::string& key, const std::string& where) {
  if (range.holds(value)) return;
  throw run::ConfigError(fmt::format("{}: \"{}\" must be {}, got {}", where, key, range.text(), value));
}

void check_words(const std::vector<std::string>& words, const nlohmann::ordered_json& value,
                 const std::string& where) {
  if (value.is_string()) require_one_of(value.get<std::string>(), words, where);
  if (!value.is_array()) return;
  for (const nlohmann::ordered_json& word : value) require_one_of(word.get<std::string>(), words, where);
}

}  // namespace q3d::pipeline::config
