#include "loaders/formats/several_animals.h"

#include <algorithm>
#include <array>
#include <cstddef>

namespace q3d::loaders::formats {
namespace {

using nlohmann::json;

constexpr std::array<const char*, 7> kNumbersOfAnAnimal{"bbox",  "keypoint_2d", "keypoint_3d", "pose",
                                                        "shape", "shape_extra", "trans"};

// Returns the value of a field, or null if it is absent or null.
const json* value_of(const json& record, const char* field) {
  const auto found = record.find(field);
  return found == record.end() || found->is_null() ? nullptr : &*found;
}

bool has_one_list_an_animal(const json& value, std::size_t animals) {
  return value.is_array() && value.size() == animals &&
         std::all_of(value.begin(), value.end(), [](const json& each) { return each.is_array(); });
}

}  // namespace

bool holds_several_animals(const json& record) {
  if (!record.is_object()) return false;
  const json* boxes = value_of(record, "bbox");
  return boxes != nullptr && boxes->is_array() && !boxes->empty() &&
         std::all_of(boxes->begin(), boxes->end(),
                     [](const json& box) { return box.is_array() && box.size() == 4; });
}

std::vector<json> one_record_an_animal(const json& record) {
  if (!holds_several_animals(record) || value_of(record, "keypoint_2d") == nullptr) return {};
  std::vector<json> animals(record["bbox"].size(), record);
  for (const char* field : kNumbersOfAnAnimal) {
    const json* values = value_of(record, field);
    if (values == nullptr) continue;
    if (!has_one_list_an_animal(*values, animals.size())) return {};
    for (std::size_t k = 0; k < animals.size(); ++k) animals[k][field] = (*values)[k];
  }
  for (const char* field : {"mask_path", "supercategory"}) {
    const json* values = value_of(record, field);
    if (values == nullptr || !values->is_array() || values->size() != animals.size()) continue;
    for (std::size_t k = 0; k < animals.size(); ++k) animals[k][field] = (*values)[k];
  }
  for (json& animal : animals) {
    const json* mask = value_of(animal, "mask_path");
    if (animals.size() > 1 && mask != nullptr && *mask == record["mask_path"]) animal.erase("mask_path");
  }
  return animals;
}

}  // namespace q3d::loaders::formats
