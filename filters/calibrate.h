// Thresholds from target shares.
#pragma once

#include <span>

#include "filters/fidelity.h"

namespace q3d::filters {

struct TargetShares {  // of all judged candidates; the paper: 5 of 14, 4 of 14, 5 of 14
  double retained = 5.0 / 14.0;
  double refined = 4.0 / 14.0;
};

// One judged candidate of the pool.
struct CalibrationSample {
  double initial_error = 0.0;
  bool passes_adaptation = true;  // reaches delta (or tau_low) when adapted
};

// tau_low is the retained share's quantile of the initial error; tau_high lets in as many of the middle band
// as give the refined share after those that fail delta have dropped out. Throws std::invalid_argument for an
// empty pool or shares that do not lie in (0, 1) together.
Thresholds calibrate(std::span<const CalibrationSample> pool, const TargetShares& shares,
                     const Thresholds& base);

}  // namespace q3d::filters
