#include "pipeline/evaluation/report_values.h"

#include <fmt/format.h>

namespace q3d::pipeline::evaluation {

std::string number_text(const std::optional<double>& value) {
  return value ? fmt::format("{}", *value) : std::string();
}

nlohmann::ordered_json number_or_null(const std::optional<double>& value) {
  return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
}

std::string normaliser_name(std::int64_t by_mask, std::int64_t samples) {
  if (samples == 0) return "";
  if (by_mask == samples) return "mask";
  return by_mask == 0 ? "crop" : "mask and crop";
}

}  // namespace q3d::pipeline::evaluation
