#include "model/settings/loss_weights.h"

#include <array>

#include "manifests/enum_names.h"

namespace q3d::model::settings {
namespace {

constexpr std::array<std::string_view, 2> kVariantNames{"sound", "official"};
static_assert(kVariantNames.size() == static_cast<std::size_t>(LossVariant::official) + 1);

}  // namespace

std::string_view to_string(LossVariant variant) {
  return kVariantNames.at(static_cast<std::size_t>(variant));
}

std::vector<std::string> loss_variant_names() {
  return {kVariantNames.begin(), kVariantNames.end()};
}

LossVariant loss_variant_from_string(std::string_view name) {
  return manifests::enum_from_name<LossVariant>("loss variant", name, kVariantNames);
}

}  // namespace q3d::model::settings
