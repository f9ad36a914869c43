// The fidelity rule. Paper section "Fidelity-Aware Pseudo-GT Construction".
#pragma once

#include <span>

#include "manifests/verdict.h"

namespace q3d::filters {

struct Thresholds {
  double tau_low = 0.0;   // crop units
  double tau_high = 0.0;  // crop units
  double delta = 0.05;    // relative gain that adaptation must reach within gain_window iterations
  int gain_window = 10;
  int iterations_min = 10;
  int iterations_max = 60;
};
// Throws std::invalid_argument unless 0 < tau_low <= tau_high, 0 <= delta < 1 and the iterations are ordered.
void check(const Thresholds& thresholds);

enum class Band { retain, refine, discard };

// By the initial L_proj: below tau_low, the middle band, tau_high and above.
Band band(double initial_error, const Thresholds& thresholds);

// round(min + (max - min) (L0 - tau_low) / (tau_high - tau_low)) for a sample of the middle band.
int adaptation_iterations(double initial_error, const Thresholds& thresholds);

// Verdict of a sample that was not adapted (retained, or discarded as error_too_large).
manifests::Judgement judge_initial(double initial_error, const Thresholds& thresholds);

// Verdict after adaptation, from L_proj of iterates 0..n. A curve that falls below tau_low has passed; else
// the relative gain within the first gain_window iterations must reach delta.
manifests::Judgement judge_adapted(std::span<const double> curve, const Thresholds& thresholds);

}  // namespace q3d::filters
