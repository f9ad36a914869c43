#include "pipeline/config/role.h"

#include "manifests/enum_names.h"

namespace q3d::pipeline::config {
namespace {

constexpr manifests::EnumNames kRoles("role", Role::pseudo, Role::two_d_only, {"pseudo", "truth", "2d_only"});

}  // namespace

std::string_view to_string(Role role) {
  return kRoles.name(role);
}

std::vector<std::string> role_names() {
  return {kRoles.all().begin(), kRoles.all().end()};
}

Role role_from_string(std::string_view name) {
  return kRoles.value(name);
}

manifests::LabelKind label_kind(Role role, manifests::Verdict verdict) {
  using manifests::LabelKind;
  switch (role) {
    case Role::truth:
      return LabelKind::truth;
    case Role::two_d_only:
      return LabelKind::two_d_only;
    case Role::pseudo:
      break;
  }
  return verdict == manifests::Verdict::refined ? LabelKind::refined : LabelKind::retained;
}

}  // namespace q3d::pipeline::config
