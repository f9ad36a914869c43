// The fidelity rule. Paper section "Fidelity-Aware Pseudo-GT Construction".
#pragma once

#include <span>

#include "filters/adaptation/schedule.h"
#include "manifests/verdict.h"

namespace q3d::filters {

struct Thresholds {
  double tau_low = 0.0;   // crop units
  double tau_high = 0.0;  // crop units
  double delta = 0.05;    // relative gain that adaptation must reach within gain_window iterations
  int gain_window = 10;
  int iterations_min = 10;
  int iterations_max = 60;
  double stop_below = 0.0;       // crop units; adaptation ends as soon as L_proj is below it; 0 = never
  bool refine_retained = false;  // adapts samples below tau_low too, and keeps them in any case
};
// Throws std::invalid_argument that names the threshold unless 0 < tau_low <= tau_high, 0 <= delta < 1,
// gain_window >= 1, 1 <= iterations_min <= iterations_max and 0 <= stop_below <= tau_low.
void check(const Thresholds& thresholds);

enum class Band { retain, refine, discard };

// Returns the band of an initial L_proj: retain below tau_low, refine in the middle band [tau_low, tau_high),
// discard from tau_high on and for NaN.
Band band(double initial_error, const Thresholds& thresholds);

// Returns whether a sample of this initial L_proj is adapted: one of the middle band, and with
// refine_retained one below tau_low.
bool is_adapted(double initial_error, const Thresholds& thresholds);

// Returns how a sample is adapted. In the middle band it takes round(min + (max - min) (L0 - tau_low) /
// (tau_high - tau_low)) iterations, with halves rounded up, and ends after the gain's window if the gain is
// below delta. Below tau_low it takes the least number of iterations and asks for no gain. Neither ends when
// L_proj falls below tau_low: tau_low decides only who is retained as predicted. Throws std::invalid_argument
// for a sample that is not adapted.
adaptation::Schedule adaptation_schedule(double initial_error, const Thresholds& thresholds);

// Returns the verdict without adaptation. Below tau_low a sample is retained. From tau_high on it is
// discarded as error_too_large. In the middle band it is discarded as gain_too_small, because it has shown no
// gain until judge_adapted has seen its curve. An error that is not finite is a failure
// (prediction_not_finite).
manifests::Judgement judge_initial(double initial_error, const Thresholds& thresholds);

// Returns the verdict on a sample of the middle band after adaptation. `curve` is L_proj of the iterates
// 0..n. The relative gain (L0 - min over iterates 1..gain_window) / L0 must reach delta, whatever L_proj has
// become. Only a curve that ended below stop_below before the window was full passes without the test,
// because adaptation was told to end there. The kept iterate is the first with the least L_proj, iterate 0
// included. Iterates that are not finite are skipped. A curve that is empty or starts with such an iterate is
// a failure (prediction_not_finite).
manifests::Judgement judge_adapted(std::span<const double> curve, const Thresholds& thresholds);

// Returns the verdict on a sample of the middle band of which adaptation did not see all keypoints.
// `held_out` is the error of the hidden keypoints; `curve` is the error of all visible keypoints, for the
// same iterates. The kept iterate is the first with the least held-out error. This asks for more than the
// paper's rule: the kept iterate must not be the prediction itself (held_out_not_better), because an
// adaptation that does not improve unseen points has not found a better body. Throws std::invalid_argument if
// the lengths differ.
manifests::Judgement judge_held_out(std::span<const double> curve, std::span<const double> held_out,
                                    const Thresholds& thresholds);

// Returns the verdict on a sample below tau_low that was adapted (refine_retained). It is kept in any case:
// as refined if an iterate is better than the prediction, else as retained. `chosen_by` holds the errors by
// which the iterate is chosen: `curve` itself, or the held-out errors of the same iterates. Failures and
// throws as above.
manifests::Judgement judge_retained(std::span<const double> curve, std::span<const double> chosen_by,
                                    const Thresholds& thresholds);

}  // namespace q3d::filters
