#include "manifests/verdict.h"

#include "manifests/enum_names.h"
#include "manifests/enumerators.h"

namespace q3d::manifests {
namespace {

constexpr EnumNames kVerdicts("verdict", Verdict::retained, Verdict::failed,
                              {"retained", "refined", "discarded", "failed"});
constexpr EnumNames kLabelKinds("label kind", LabelKind::truth, LabelKind::two_d_only,
                                {"truth", "retained", "refined", "2d_only"});

}  // namespace

std::string_view to_string(Verdict verdict) {
  return kVerdicts.name(verdict);
}

Verdict verdict_from_string(std::string_view name) {
  return kVerdicts.value(name);
}

std::span<const std::string_view> verdict_names() {
  return kVerdicts.all();
}

std::string_view to_string(LabelKind kind) {
  return kLabelKinds.name(kind);
}

LabelKind label_kind_from_string(std::string_view name) {
  return kLabelKinds.value(name);
}

std::span<const std::string_view> label_kind_names() {
  return kLabelKinds.all();
}

}  // namespace q3d::manifests
