#include "pipeline/device/domain.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>

#include "manifests/enum_names.h"
#include "manifests/json_number.h"
#include "manifests/json_parse.h"

namespace q3d::pipeline::device {
namespace {

using nlohmann::json;

constexpr manifests::EnumNames kPictures("kind of pictures", Pictures::unknown, Pictures::rendered,
                                         {"unknown", "photographs", "rendered"});

std::vector<ErrorQuantile> quantiles_from(const json& l_proj) {
  std::vector<ErrorQuantile> quantiles;
  for (const auto& [share, error] : l_proj.items()) {
    double number = 0.0;
    const auto [end, problem] = std::from_chars(share.data(), share.data() + share.size(), number);
    if (problem != std::errc() || end != share.data() + share.size()) {
      throw std::runtime_error(fmt::format("l_proj: got the share \"{}\", expected a number", share));
    }
    quantiles.push_back({number, error.get<double>()});
  }
  std::sort(quantiles.begin(), quantiles.end(),
            [](const ErrorQuantile& a, const ErrorQuantile& b) { return a.share < b.share; });
  for (std::size_t i = 0; i < quantiles.size(); ++i) {
    const ErrorQuantile& each = quantiles[i];
    const bool ascends = i == 0 || each.l_proj >= quantiles[i - 1].l_proj;
    if (!(each.share > 0.0 && each.share < 1.0 && std::isfinite(each.l_proj) && each.l_proj >= 0.0 &&
          ascends)) {
      throw std::runtime_error(fmt::format(
          "l_proj: got {} at the share {}, expected shares between 0 and 1 and ascending errors of 0 or more",
          each.l_proj, each.share));
    }
  }
  return quantiles;
}

}  // namespace

Pictures pictures_from_string(std::string_view name) {
  return kPictures.value(name);
}

std::string to_json(const NetworkDomain& domain) {
  json document = {{"pictures", kPictures.name(domain.pictures)}, {"trained_on", domain.trained_on}};
  if (!domain.quantiles.empty()) {
    json l_proj = json::object();
    for (const ErrorQuantile& each : domain.quantiles) l_proj[fmt::format("{}", each.share)] = each.l_proj;
    document["held_out"] = {
        {"pictures", domain.held_out_pictures}, {"what", domain.held_out}, {"l_proj", l_proj}};
  }
  return document.dump();
}

NetworkDomain domain_from_json(const std::string& text) {
  try {
    const json document = manifests::parse_json<json>(text);
    NetworkDomain domain;
    domain.pictures = kPictures.value(document.at("pictures").get<std::string>());
    domain.trained_on = document.at("trained_on").get<std::string>();
    if (!document.contains("held_out")) return domain;
    const json& held_out = document.at("held_out");
    domain.held_out = held_out.at("what").get<std::string>();
    domain.held_out_pictures = manifests::whole_number_at(held_out, "pictures");
    domain.quantiles = quantiles_from(held_out.at("l_proj"));
    return domain;
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format(
        "'{}': {}; expected the form that pipeline/device/domain.h describes", kDomainKey, error.what()));
  }
}

std::optional<double> quantile(const NetworkDomain& domain, double share) {
  for (const ErrorQuantile& each : domain.quantiles) {
    if (each.share == share) return each.l_proj;
  }
  return std::nullopt;
}

std::vector<ErrorQuantile> quantiles_of(std::vector<double> errors, const std::vector<double>& shares) {
  if (errors.empty()) throw std::invalid_argument("quantiles_of: got no errors");
  for (const double error : errors) {
    if (!std::isfinite(error)) throw std::invalid_argument("quantiles_of: got an error that is not finite");
  }
  std::sort(errors.begin(), errors.end());
  std::vector<ErrorQuantile> quantiles;
  for (const double share : shares) {
    const double at = share * static_cast<double>(errors.size() - 1);
    const auto below = static_cast<std::size_t>(at);
    const std::size_t above = std::min(below + 1, errors.size() - 1);
    const double part = at - static_cast<double>(below);
    quantiles.push_back({share, errors[below] + part * (errors[above] - errors[below])});
  }
  return quantiles;
}

}  // namespace q3d::pipeline::device
