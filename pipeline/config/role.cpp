#include "pipeline/config/role.h"

#include <array>

#include "manifests/enum_names.h"

namespace q3d::pipeline::config {
namespace {

constexpr std::array<std::string_view, 3> kRoleNames{"pseudo", "truth", "2d_only"};
static_assert(kRoleNames.size() == static_cast<std::size_t>(Role::two_d_only) + 1);

}  // namespace

std::string_view to_string(Role role) {
  return kRoleNames.at(static_cast<std::size_t>(role));
}

std::vector<std::string> role_names() {
  return {kRoleNames.begin(), kRoleNames.end()};
}

Role role_from_string(std::string_view name) {
  return manifests::enum_from_name<Role>("role", name, kRoleNames);
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
