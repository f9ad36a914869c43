#include "pipeline/config/profiles.h"

#include <map>

namespace q3d::pipeline::config {
namespace {

using nlohmann::json;

// Bounds lie a little beyond what true bodies of the rendered world reach, so that they catch what no animal
// does. The two guards that shorten adaptation are not among them: with them labels were worse
// (docs/results.md). Poses reach up to 2.1 standard deviations, limbs up to 1.4 times beyond the families'
// means.
const std::map<std::string, json>& profiles() {
  static const std::map<std::string, json> kProfiles{{"paper", json::object()},
                                                     {"strict", json::parse(R"({"guards": {
         "visible_min": 8,
         "pose_deviation_max": 2.5,
         "limb_factor_max": 1.5,
         "left_right_max": 1.0,
         "mask_iou_min": 0.5
       }})")}};
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
