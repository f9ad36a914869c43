// The rules by which a build judges: the thresholds of each dataset and the guards.
#pragma once

#include <map>
#include <string>

#include "filters/fidelity.h"
#include "pipeline/config/build_config.h"

namespace q3d::pipeline::config {

struct JudgingRules {
  std::map<std::string, filters::Thresholds> thresholds;  // by dataset, of those of role `pseudo`
  GuardConfig guards;
  double min_trust = 0.0;  // least combined trust of a kept label; 0 = off

  // Throws std::out_of_range for a dataset without pseudo labels.
  const filters::Thresholds& of(const std::string& dataset) const { return thresholds.at(dataset); }
};

// Returns the rules of a calibrated config. They have no thresholds if no dataset has the role `pseudo`. A
// dataset's own thresholds replace the common ones. Throws ConfigError that names a dataset without
// thresholds, and `calibrate`.
JudgingRules judging_rules(const BuildConfig& config);

}  // namespace q3d::pipeline::config
