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
// Throws std::invalid_argument that names the threshold unless 0 < tau_low <= tau_high, 0 <= delta < 1,
// gain_window >= 1 and 1 <= iterations_min <= iterations_max.
void check(const Thresholds& thresholds);

enum class Band { retain, refine, discard };

// Returns the band of an initial L_proj: retain below tau_low, refine in the middle band [tau_low, tau_high),
// discard from tau_high on and for NaN.
Band band(double initial_error, const Thresholds& thresholds);

// Returns the number of adaptation iterations, round(min + (max - min) (L0 - tau_low) / (tau_high -
// tau_low)), with halves rounded up. Throws std::invalid_argument for a sample outside the middle band.
int adaptation_iterations(double initial_error, const Thresholds& thresholds);

// Returns the verdict without adaptation. Below tau_low a sample is retained. From tau_high on it is
// discarded as error_too_large. In the middle band it is discarded as gain_too_small, because it has shown no
// gain until judge_adapted has seen its curve. An error that is not finite is a failure
// (prediction_not_finite).
manifests::Judgement judge_initial(double initial_error, const Thresholds& thresholds);

// Returns the verdict after adaptation. `curve` is L_proj of the iterates 0..n of a sample that was sent to
// adaptation. A curve that falls below tau_low passes. Otherwise the relative gain (L0 - min over iterates
// 1..gain_window) / L0 must reach delta. The kept iterate is the first with the least L_proj, iterate 0
// included. Iterates that are not finite are skipped. A curve that is empty or starts with such an iterate is
// a failure (prediction_not_finite).
manifests::Judgement judge_adapted(std::span<const double> curve, const Thresholds& thresholds);

// The same for a sample of which adaptation did not see all keypoints. `held_out` is the error of the hidden
// keypoints; `curve` is the error of all visible keypoints, for the same iterates. The kept iterate is the
// first with the least held-out error. This asks for more than the paper's rule: the iterate that must be
// below tau_low is the kept one, and the kept one must not be the prediction itself (held_out_not_better),
// because an adaptation that does not improve unseen points has not found a better body. Throws
// std::invalid_argument if the lengths differ.
manifests::Judgement judge_held_out(std::span<const double> curve, std::span<const double> held_out,
                                    const Thresholds& thresholds);

}  // namespace q3d::filters
