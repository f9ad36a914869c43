#include "loaders/formats/coco_ids.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace q3d::loaders::formats {

std::optional<CocoId> coco_id(const nlohmann::json& value) {
  if (value.is_number_unsigned()) return CocoId{std::to_string(value.get<std::uint64_t>())};
  if (value.is_number_integer()) return CocoId{std::to_string(value.get<std::int64_t>())};
  if (value.is_number_float()) {
    constexpr double kFirstInexact = 9007199254740992.0;  // 2^53
    const double number = value.get<double>();
    if (number != std::floor(number) || std::abs(number) >= kFirstInexact) return std::nullopt;
    return CocoId{std::to_string(static_cast<std::int64_t>(number))};
  }
  if (value.is_string() && !value.get_ref<const std::string&>().empty()) {
    return CocoId{value.get<std::string>(), true};
  }
  return std::nullopt;
}

std::optional<CocoId> coco_id(const nlohmann::json& object, const char* field) {
  if (!object.is_object()) return std::nullopt;
  const auto found = object.find(field);
  return found == object.end() ? std::nullopt : coco_id(*found);
}

CocoId coco_id_of_key(const std::string& key) {
  const CocoId text{key, true};
  const auto number = number_of(text);
  return number == key ? CocoId{key} : text;
}

std::optional<std::string> number_of(const CocoId& id) {
  std::string text = id.text;
  const bool is_negative = text.starts_with('-');
  if (is_negative) text.erase(0, 1);
  if (text.ends_with(".0")) text.resize(text.size() - 2);
  if (text.empty() || text.find_first_not_of("0123456789") != std::string::npos) return std::nullopt;
  text.erase(0, std::min(text.find_first_not_of('0'), text.size() - 1));
  return is_negative && text != "0" ? "-" + text : text;
}

}  // namespace q3d::loaders::formats
