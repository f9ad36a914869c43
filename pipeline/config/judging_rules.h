// A build judges by these rules: the thresholds of each dataset and the guards.
#pragma once

#include <map>
#include <string>

#include "filters/fidelity.h"
#include "pipeline/config/build_config.h"

namespace q3d::pipeline::config {

struct JudgingRules {
  std::map<std::string, filters::Thresholds> thresholds;  // by dataset, of those of role `pseudo`
  GuardConfig guards;
  double min_trust = 0.0;  // of a kept label's combined trust; 0 = off

  // Throws std::out_of_range for a dataset without pseudo labels.
  const filters::Thresholds& of(const std::string& dataset) const { return thresholds.at(dataset); }
};

// The rules of a calibrated config; without thresholds when no dataset has the role `pseudo`. A dataset's own
// thresholds come before the common ones. Throws ConfigError naming the dataset that has none, and
// `calibrate`.
JudgingRules judging_rules(const BuildConfig& config);

}  // namespace q3d::pipeline::config
