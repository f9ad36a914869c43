#include "manifests/verdict.h"

#include "manifests/enum_names.h"
#include "manifests/enumerators.h"

namespace q3d::manifests {
namespace {

constexpr std::array<std::string_view, 4> kVerdictNames{"retained", "refined", "discarded", "failed"};
static_assert(kVerdictNames.size() == static_cast<std::size_t>(Verdict::failed) + 1);
constexpr std::array<std::string_view, 4> kLabelKindNames{"truth", "retained", "refined", "2d_only"};
static_assert(kLabelKindNames.size() == static_cast<std::size_t>(LabelKind::two_d_only) + 1);

}  // namespace

std::string_view to_string(Verdict verdict) {
  return kVerdictNames.at(static_cast<std::size_t>(verdict));
}

Verdict verdict_from_string(std::string_view name) {
  return enum_from_name<Verdict>("verdict", name, kVerdictNames);
}

std::span<const std::string_view> verdict_names() {
  return kVerdictNames;
}

std::string_view to_string(LabelKind kind) {
  return kLabelKindNames.at(static_cast<std::size_t>(kind));
}

LabelKind label_kind_from_string(std::string_view name) {
  return enum_from_name<LabelKind>("label kind", name, kLabelKindNames);
}

std::span<const std::string_view> label_kind_names() {
  return kLabelKindNames;
}

}  // namespace q3d::manifests
