#include "pipeline/config/network_words.h"

#include "manifests/enum_names.h"

namespace q3d::pipeline::config {
namespace {

constexpr manifests::EnumNames kDtypes("dtype", Dtype::float32, Dtype::bfloat16, {"float32", "bfloat16"});
constexpr manifests::EnumNames kObjectives("objective", TtaObjective::paper, TtaObjective::demo,
                                           {"paper", "demo"});

}  // namespace

std::string_view to_string(Dtype dtype) {
  return kDtypes.name(dtype);
}

Dtype dtype_from_string(std::string_view name) {
  return kDtypes.value(name);
}

std::span<const std::string_view> dtype_names() {
  return kDtypes.all();
}

std::string_view to_string(TtaObjective objective) {
  return kObjectives.name(objective);
}

TtaObjective tta_objective_from_string(std::string_view name) {
  return kObjectives.value(name);
}

std::span<const std::string_view> tta_objective_names() {
  return kObjectives.all();
}

}  // namespace q3d::pipeline::config
