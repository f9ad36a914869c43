// Judges whether labels are good in absolute terms. The shares of a calibration do not show this, because any
// set of pictures meets them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/config/build_config.h"
#include "pipeline/config/judging_rules.h"
#include "pipeline/dataset/dataset_manifest.h"
#include "pipeline/dataset/warnings.h"
#include "pipeline/device/domain.h"

namespace q3d::pipeline::build {

// One dataset with pseudo labels, with all its splits.
struct PoolErrors {
  std::string dataset;
  bool is_rendered = false;    // every picture comes from `sample`
  std::vector<double> errors;  // L_proj of the predictions, crop units
  double tau_high = 0.0;       // crop units
};

// The origins of network and body, as their files state them.
struct Origins {
  device::NetworkDomain domain;
  bool has_rendered_body = false;
};

// Returns the warnings in the order of WarningKind and, within a kind, of the datasets. A pool counts as
// outside the domain if the median of its errors is above the 0.95 quantile of the network's own held-out
// pictures.
std::vector<dataset::Warning> quality_warnings(const std::vector<PoolErrors>& pools, const Origins& origins,
                                               double tau_ceiling);

// Throws std::runtime_error that names dataset, tau_high and ceiling, and says what to do, for the first of
// the thresholds above the ceiling.
void require_below_ceiling(const std::string& dataset, double tau_high, double tau_ceiling);

// Returns the rules of a build after all checks that need only its config. Throws ConfigError, and as
// require_below_ceiling does unless `above_ceiling`.
config::JudgingRules checked_rules(const config::BuildConfig& config, bool above_ceiling);

// Throws std::runtime_error that says why, if the dataset in `folder` has no label, or if more than
// `max_failed_share` of its candidates failed.
void require_labels(const dataset::DatasetManifest& manifest, const std::filesystem::path& folder,
                    double max_failed_share);

}  // namespace q3d::pipeline::build
