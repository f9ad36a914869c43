// Finds the thresholds that give target shares.
#pragma once

#include <span>

#include "filters/fidelity.h"

namespace q3d::filters {

struct TargetShares {  // shares of all judged candidates; the paper's are 5/14, 4/14 and 5/14
  double retained = 5.0 / 14.0;
  double refined = 4.0 / 14.0;
};

// One judged candidate of the pool.
struct CalibrationSample {
  double initial_error = 0.0;
  bool passes_adaptation = true;  // the fidelity rule keeps it when it is adapted
};

struct Calibration {
  Thresholds thresholds;
  // The shares of the whole pool that the thresholds give.
  double retained = 0.0;
  double refined = 0.0;
  double discarded = 0.0;
  // False if a share is off its target by more than one sample, because of ties in the errors or because too
  // few samples pass adaptation.
  bool reached = false;
};

// tau_low is the quantile of the initial error at the retained share. tau_high is such that the middle band
// gives the refined share after the samples that fail adaptation have dropped out. If a share cannot be met,
// the closest one is taken. Each threshold lies halfway between two errors of the pool, so that a value
// rounded for a config still separates them. `base` gives delta, gain window and iterations. Throws
// std::invalid_argument for an empty pool, for errors that are negative or not finite, and for shares that
// are not above 0 or whose sum is not below 1.
Calibration calibrate(std::span<const CalibrationSample> pool, const TargetShares& shares,
                      const Thresholds& base);

}  // namespace q3d::filters
