#include "pipeline/config/judging_rules.h"

#include <fmt/format.h>

#include <stdexcept>

#include "pipeline/run/errors.h"

namespace q3d::pipeline::config {
namespace {

constexpr const char* kCalibrate =
    "the thresholds depend on the pool and the network, so there is no default. Run `quadruped3d calibrate` "
    "with the same config; it prints them and writes a file that `build --config` takes as a second layer";

filters::Thresholds thresholds_of(const std::string& dataset, const BuildConfig& config) {
  const auto own = config.filter.datasets.find(dataset);
  const DatasetThresholds given = own == config.filter.datasets.end() ? DatasetThresholds{} : own->second;
  const auto tau_low = given.tau_low ? given.tau_low : config.filter.tau_low;
  const auto tau_high = given.tau_high ? given.tau_high : config.filter.tau_high;
  if (!tau_low || !tau_high) {
    if (config.filter.datasets.empty()) {
      throw run::ConfigError(
          fmt::format("the config has no \"filter\": {{\"tau_low\", \"tau_high\"}}: {}", kCalibrate));
    }
    throw run::ConfigError(
        fmt::format("the dataset {0} has no thresholds: the config gives neither \"filter\": {{\"datasets\": "
                    "{{\"{0}\": {{\"tau_low\", \"tau_high\"}}}}}} nor common ones: {1}",
                    dataset, kCalibrate));
  }
  filters::Thresholds thresholds;
  thresholds.tau_low = *tau_low;
  thresholds.tau_high = *tau_high;
  thresholds.delta = given.delta.value_or(config.filter.delta);
  thresholds.iterations_min = config.tta.iterations_min;
  thresholds.iterations_max = config.tta.iterations_max;
  thresholds.stop_below = config.tta.stop_below;
  thresholds.refine_retained = config.tta.refine_retained;
  try {
    filters::check(thresholds);
  } catch (const std::invalid_argument& error) {
    throw run::ConfigError(fmt::format("filter: dataset {}: {}", dataset, error.what()));
  }
  return thresholds;
}

}  // namespace

JudgingRules judging_rules(const BuildConfig& config) {
  JudgingRules rules;
  rules.guards = config.guards;
  rules.min_trust = config.filter.min_trust;
  for (const DatasetConfig& dataset : config.datasets) {
    if (dataset.role == Role::pseudo) {
      rules.thresholds.emplace(dataset.name, thresholds_of(dataset.name, config));
    }
  }
  return rules;
}

}  // namespace q3d::pipeline::config
