#include "pipeline/dataset/warnings.h"

#include <array>

#include "manifests/enum_names.h"

namespace q3d::pipeline::dataset {
namespace {

constexpr std::array<std::string_view, 4> kNames{"above_ceiling", "outside_domain", "rendered_network",
                                                 "rendered_body"};
static_assert(kNames.size() == static_cast<std::size_t>(WarningKind::rendered_body) + 1);

}  // namespace

std::string_view to_string(WarningKind kind) {
  return kNames.at(static_cast<std::size_t>(kind));
}

WarningKind warning_kind_from_string(std::string_view name) {
  return manifests::enum_from_name<WarningKind>("kind of warning", name, kNames);
}

std::span<const std::string_view> warning_kind_names() {
  return kNames;
}

nlohmann::ordered_json to_json(const std::vector<Warning>& warnings) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Warning& warning : warnings) {
    nlohmann::ordered_json dataset = nullptr;
    if (!warning.dataset.empty()) dataset = warning.dataset;
    list.push_back({{"kind", to_string(warning.kind)}, {"dataset", dataset}, {"message", warning.message}});
  }
  return list;
}

}  // namespace q3d::pipeline::dataset
