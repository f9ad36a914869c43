#include "pipeline/evaluation/setting.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "filters/keypoint_choice.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::evaluation {
namespace {

void add_kept_iterate(Plan& plan, int iterations, double share) {
  std::string name = fmt::format("TTA {}", iterations);
  if (share < 1.0) name += fmt::format(" with {:g} % of the keypoints", 100.0 * share);
  plan.settings.push_back({name, true, iterations, share});
  plan.passes.push_back({iterations, share, {}});
}

void check(const SettingOptions& options) {
  if (options.tta_iterations < 0) {
    throw run::ConfigError(fmt::format("TTA iterations: got {}, expected 0 or more", options.tta_iterations));
  }
  for (const int iterate : options.curve) {
    if (iterate < 0)
      throw run::ConfigError(fmt::format("iterates to measure: got {}, expected 0 or more", iterate));
  }
  for (const double share : options.visible_shares) {
    if (!(share > 0.0 && share <= 1.0)) {
      throw run::ConfigError(
          fmt::format("shares of visible keypoints: got {}, expected more than 0, at most 1", share));
    }
  }
  if (!options.visible_shares.empty() && options.tta_iterations == 0) {
    throw run::ConfigError(
        "shares of visible keypoints say what adaptation is given: say how many iterations too");
  }
}

}  // namespace

Plan plan_settings(const SettingOptions& options) {
  check(options);
  Plan plan;
  plan.settings.push_back({"prediction", false, 0, 1.0});
  if (options.tta_iterations > 0) add_kept_iterate(plan, options.tta_iterations, 1.0);
  std::vector<double> shares = options.visible_shares;
  std::sort(shares.rbegin(), shares.rend());
  shares.erase(std::unique(shares.begin(), shares.end()), shares.end());
  for (const double share : shares) {
    if (share < 1.0) add_kept_iterate(plan, options.tta_iterations, share);
  }
  std::vector<int> curve = options.curve;
  std::sort(curve.begin(), curve.end());
  curve.erase(std::unique(curve.begin(), curve.end()), curve.end());
  if (curve.empty()) return plan;
  for (const int iterate : curve) {
    plan.settings.push_back({fmt::format("iterate {}", iterate), iterate > 0, iterate, 1.0});
  }
  plan.passes.push_back({curve.back(), 1.0, curve});
  return plan;
}

device::CropKeypoints hide_keypoints(const device::CropKeypoints& keypoints, double share, std::uint64_t seed,
                                     const std::string& sample_id) {
  const std::vector<std::size_t> visible = filters::shuffled_visible(keypoints, seed, sample_id);
  // The tolerance makes ceil(0.7 * 10) 7, not 8.
  const auto shown = static_cast<std::size_t>(std::ceil(share * static_cast<double>(visible.size()) - 1e-9));
  device::CropKeypoints result = keypoints;
  for (std::size_t i = shown; i < visible.size(); ++i) result[visible[i]].weight = 0.0F;
  return result;
}

}  // namespace q3d::pipeline::evaluation
