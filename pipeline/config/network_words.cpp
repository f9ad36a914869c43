#include "pipeline/config/network_words.h"

#include <array>

#include "manifests/enum_names.h"

namespace q3d::pipeline::config {
namespace {

constexpr std::array<std::string_view, 2> kDtypeNames{"float32", "bfloat16"};
static_assert(kDtypeNames.size() == static_cast<std::size_t>(Dtype::bfloat16) + 1);

constexpr std::array<std::string_view, 2> kObjectiveNames{"paper", "demo"};
static_assert(kObjectiveNames.size() == static_cast<std::size_t>(TtaObjective::demo) + 1);

}  // namespace

std::string_view to_string(Dtype dtype) {
  return kDtypeNames.at(static_cast<std::size_t>(dtype));
}

Dtype dtype_from_string(std::string_view name) {
  return manifests::enum_from_name<Dtype>("dtype", name, kDtypeNames);
}

std::span<const std::string_view> dtype_names() {
  return kDtypeNames;
}

std::string_view to_string(TtaObjective objective) {
  return kObjectiveNames.at(static_cast<std::size_t>(objective));
}

TtaObjective tta_objective_from_string(std::string_view name) {
  return manifests::enum_from_name<TtaObjective>("objective", name, kObjectiveNames);
}

std::span<const std::string_view> tta_objective_names() {
  return kObjectiveNames;
}

}  // namespace q3d::pipeline::config
