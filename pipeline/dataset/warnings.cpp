#include "pipeline/dataset/warnings.h"

#include "manifests/enum_names.h"

namespace q3d::pipeline::dataset {
namespace {

constexpr manifests::EnumNames kKinds("kind of warning", WarningKind::above_ceiling,
                                      WarningKind::rendered_body,
                                      {"above_ceiling", "outside_domain", "rendered_network",
                                       "rendered_body"});

}  // namespace

std::string_view to_string(WarningKind kind) {
  return kKinds.name(kind);
}

WarningKind warning_kind_from_string(std::string_view name) {
  return kKinds.value(name);
}

std::span<const std::string_view> warning_kind_names() {
  return kKinds.all();
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
