#include "pipeline/config/profiles.h"

#include <map>

namespace q3d::pipeline::config {
namespace {

using nlohmann::json;

// `strict` has the settings that made labels more accurate on worlds that were not used to choose it
// (docs/results.md): every kept prediction is adapted, the pose prior takes part in adaptation, and min_trust
// discards the least trusted fifth of the labels in the world of the fit. The guards that bound labels
// selected no better than a lower tau_high, so they are not part of it.
const std::map<std::string, json>& profiles() {
  static const std::map<std::string, json> kProfiles{
      {"paper", json::object()},
      {"strict", json::parse(R"({"tta": {"refine_retained": true, "pose_prior_weight": 0.003},
                                 "filter": {"min_trust": 0.8}})")}};
  return kProfiles;
}

}  // namespace

std::vector<std::string> profile_names() {
  std::vector<std::string> names;
  for (const auto& [name, layer] : profiles()) names.push_back(name);
  return names;
}

const json& profile_layer(const std::string& name) {
  return profiles().at(name);
}

}  // namespace q3d::pipeline::config
