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
// Throws std::invalid_argument naming the threshold unless 0 < tau_low <= tau_high, 0 <= delta < 1,
// gain_window >= 1 and 1 <= iterations_min <= iterations_max.
void check(const Thresholds& thresholds);

enum class Band { retain, refine, discard };

// By the initial L_proj: below tau_low, the middle band [tau_low, tau_high), tau_high and above (NaN too).
Band band(double initial_error, const Thresholds& thresholds);

// round(min + (max - min) (L0 - tau_low) / (tau_high - tau_low)), halves up. Throws std::invalid_argument for
// a sample outside the middle band.
int adaptation_iterations(double initial_error, const Thresholds& thresholds);

// Verdict without adaptation: retained below tau_low, else discarded (error_too_large from tau_high on; a
// sample of the middle band has shown no gain, so gain_too_small until judge_adapted has seen its curve). A
// non-finite error is a failure (prediction_not_finite).
manifests::Judgement judge_initial(double initial_error, const Thresholds& thresholds);

// Verdict after adaptation, from L_proj of iterates 0..n of a sample that the caller sent to adaptation. A
// curve that falls below tau_low has passed; else the relative gain (L0 - min over iterates 1..gain_window) /
// L0 must reach delta. The kept iterate is the first of least L_proj, iterate 0 included. Iterates that are
// not finite are passed over; a curve that is empty or starts with one is a failure (prediction_not_finite).
manifests::Judgement judge_adapted(std::span<const double> curve, const Thresholds& thresholds);

// The same of a sample that adaptation did not see whole: `held_out` is the error of the keypoints that were
// kept from it, of the same iterates as `curve`, which is of all visible keypoints. The kept iterate is the
// first of least held-out error. It is asked for more than the paper's rule: the iterate that is to be below
// tau_low is the kept one, and it must not be the prediction itself (held_out_not_better), since what does
// not help the points it has not seen is no better body. Throws std::invalid_argument when the lengths
// differ.
manifests::Judgement judge_held_out(std::span<const double> curve, std::span<const double> held_out,
                                    const Thresholds& thresholds);

}  // namespace q3d::filters
