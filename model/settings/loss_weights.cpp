#include "model/settings/loss_weights.h"

#include "manifests/enum_names.h"

namespace q3d::model::settings {
namespace {

constexpr manifests::EnumNames kVariants("loss variant", LossVariant::sound, LossVariant::official,
                                         {"sound", "official"});

}  // namespace

std::string_view to_string(LossVariant variant) {
  return kVariants.name(variant);
}

std::vector<std::string> loss_variant_names() {
  return {kVariants.all().begin(), kVariants.all().end()};
}

LossVariant loss_variant_from_string(std::string_view name) {
  return kVariants.value(name);
}

}  // namespace q3d::model::settings
