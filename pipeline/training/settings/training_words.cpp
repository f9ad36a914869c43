#include "pipeline/training/settings/training_words.h"

#include <array>

#include "manifests/enum_names.h"

namespace q3d::pipeline::training::settings {
namespace {

constexpr std::array<std::string_view, 3> kPrecisionNames{"auto", "float32", "bfloat16"};
static_assert(kPrecisionNames.size() == static_cast<std::size_t>(Precision::bfloat16) + 1);

constexpr std::array<std::string_view, 2> kObjectiveNames{"prima", "encoders"};
static_assert(kObjectiveNames.size() == static_cast<std::size_t>(Objective::encoders) + 1);

constexpr std::array<std::string_view, 2> kDecayNames{"linear", "none"};
static_assert(kDecayNames.size() == static_cast<std::size_t>(Decay::none) + 1);

constexpr std::array<std::string_view, 2> kModelDtypeNames{"float32", "float16"};
static_assert(kModelDtypeNames.size() == static_cast<std::size_t>(ModelDtype::float16) + 1);

}  // namespace

std::string_view to_string(Precision precision) {
  return kPrecisionNames.at(static_cast<std::size_t>(precision));
}

Precision precision_from_string(std::string_view name) {
  return manifests::enum_from_name<Precision>("precision", name, kPrecisionNames);
}

std::span<const std::string_view> precision_names() {
  return kPrecisionNames;
}

std::string_view to_string(Objective objective) {
  return kObjectiveNames.at(static_cast<std::size_t>(objective));
}

Objective objective_from_string(std::string_view name) {
  return manifests::enum_from_name<Objective>("objective", name, kObjectiveNames);
}

std::span<const std::string_view> objective_names() {
  return kObjectiveNames;
}

std::string_view to_string(Decay decay) {
  return kDecayNames.at(static_cast<std::size_t>(decay));
}

Decay decay_from_string(std::string_view name) {
  return manifests::enum_from_name<Decay>("decay", name, kDecayNames);
}

std::span<const std::string_view> decay_names() {
  return kDecayNames;
}

std::string_view to_string(ModelDtype dtype) {
  return kModelDtypeNames.at(static_cast<std::size_t>(dtype));
}

ModelDtype model_dtype_from_string(std::string_view name) {
  return manifests::enum_from_name<ModelDtype>("model_dtype", name, kModelDtypeNames);
}

std::span<const std::string_view> model_dtype_names() {
  return kModelDtypeNames;
}

}  // namespace q3d::pipeline::training::settings
