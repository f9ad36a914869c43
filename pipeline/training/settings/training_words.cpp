#include "pipeline/training/settings/training_words.h"

#include "manifests/enum_names.h"

namespace q3d::pipeline::training::settings {
namespace {

constexpr manifests::EnumNames kPrecisions("precision", Precision::automatic, Precision::bfloat16,
                                           {"auto", "float32", "bfloat16"});
constexpr manifests::EnumNames kObjectives("objective", Objective::prima, Objective::encoders,
                                           {"prima", "encoders"});
constexpr manifests::EnumNames kDecays("decay", Decay::linear, Decay::none, {"linear", "none"});
constexpr manifests::EnumNames kModelDtypes("model_dtype", ModelDtype::float32, ModelDtype::float16,
                                            {"float32", "float16"});

}  // namespace

std::string_view to_string(Precision precision) {
  return kPrecisions.name(precision);
}

Precision precision_from_string(std::string_view name) {
  return kPrecisions.value(name);
}

std::span<const std::string_view> precision_names() {
  return kPrecisions.all();
}

std::string_view to_string(Objective objective) {
  return kObjectives.name(objective);
}

Objective objective_from_string(std::string_view name) {
  return kObjectives.value(name);
}

std::span<const std::string_view> objective_names() {
  return kObjectives.all();
}

std::string_view to_string(Decay decay) {
  return kDecays.name(decay);
}

Decay decay_from_string(std::string_view name) {
  return kDecays.value(name);
}

std::span<const std::string_view> decay_names() {
  return kDecays.all();
}

std::string_view to_string(ModelDtype dtype) {
  return kModelDtypes.name(dtype);
}

ModelDtype model_dtype_from_string(std::string_view name) {
  return kModelDtypes.value(name);
}

std::span<const std::string_view> model_dtype_names() {
  return kModelDtypes.all();
}

}  // namespace q3d::pipeline::training::settings
