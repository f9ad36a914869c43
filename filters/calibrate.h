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

struct Calibration {
  Thresholds thresholds;
  // What the thresholds give on the pool, as shares of all of it.
  double retained = 0.0;
  double refined = 0.0;
  double discarded = 0.0;
  // False when ties in the errors, or too few samples that pass adaptation, keep a share more than one sample
  // off its target.
  bool reached = false;
};

// tau_low is the retained share's quantile of the initial error; tau_high lets in as many of the middle band
// as give the refined share after those that fail adaptation have dropped out. Where a share cannot be met,
// the closest one is taken. Each threshold lies halfway between two errors of the pool, so that a value
// rounded for a config still separates them. `base` supplies delta, gain window and iterations. Throws
// std::invalid_argument for an empty pool, errors that are negative or not finite, or shares that do not lie
// in (0, 1) together.
Calibration calibrate(std::span<const CalibrationSample> pool, const TargetShares& shares,
                      const Thresholds& base);

}  // namespace q3d::filters
