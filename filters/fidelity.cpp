#include "filters/fidelity.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

namespace q3d::filters {
namespace {

using manifests::Judgement;
using manifests::Reason;
using manifests::Verdict;

void require(bool holds, std::string_view rule, double got) {
  if (!holds) throw std::invalid_argument(fmt::format("thresholds: {} must hold, got {}", rule, got));
}

Judgement not_finite(std::string_view detail) {
  Judgement judgement;
  judgement.verdict = Verdict::failed;
  judgement.reason = Reason::prediction_not_finite;
  judgement.detail = detail;
  return judgement;
}

// Returns the index of the first of the least finite values; curve[0] is finite.
std::size_t best_iterate(std::span<const double> curve) {
  std::size_t best = 0;
  for (std::size_t i = 1; i < curve.size(); ++i) {
    if (std::isfinite(curve[i]) && curve[i] < curve[best]) best = i;
  }
  return best;
}

std::optional<Judgement> find_failure(std::span<const double> curve) {
  if (curve.empty()) return not_finite("no iterate was measured");
  if (!std::isfinite(curve[0])) return not_finite("L_proj of the prediction is not finite");
  return std::nullopt;
}

std::optional<Judgement> find_failure(const char* function, std::span<const double> curve,
                                      std::span<const double> chosen_by) {
  if (chosen_by.size() != curve.size()) {
    throw std::invalid_argument(
        fmt::format("{}: got {} held-out errors of {} iterates", function, chosen_by.size(), curve.size()));
  }
  const auto failure = find_failure(curve);
  return failure ? failure : find_failure(chosen_by);
}

// The numbers of a sample whose label would be the iterate `kept`, without a verdict.
Judgement describe(std::span<const double> curve, std::size_t kept, const Thresholds& thresholds) {
  Judgement judgement;
  judgement.initial_error = curve[0];
  judgement.final_error = curve[kept];
  judgement.gain = adaptation::relative_gain(curve, thresholds.gain_window);
  judgement.iterations = static_cast<int>(curve.size()) - 1;
  judgement.best_iteration = static_cast<int>(kept);
  return judgement;
}

// Returns whether adaptation ended below stop_below before the window of the gain was full.
bool ended_early(std::span<const double> curve, const Thresholds& thresholds) {
  return curve.size() <= static_cast<std::size_t>(thresholds.gain_window) + 1 &&
         curve.back() < thresholds.stop_below;
}

// Judges a sample of the middle band whose label would be the iterate `kept`.
Judgement judge_iterate(std::span<const double> curve, std::size_t kept, const Thresholds& thresholds) {
  Judgement judgement = describe(curve, kept, thresholds);
  if (judgement.gain >= thresholds.delta || ended_early(curve, thresholds)) {
    judgement.verdict = Verdict::refined;
    return judgement;
  }
  judgement.verdict = Verdict::discarded;
  judgement.reason = Reason::gain_too_small;
  judgement.detail = fmt::format("gain {:.4g} within {} iterations, delta {:.4g}", judgement.gain,
                                 thresholds.gain_window, thresholds.delta);
  return judgement;
}

}  // namespace

void check(const Thresholds& t) {
  require(t.tau_low > 0, "0 < tau_low", t.tau_low);
  if (!(t.tau_low <= t.tau_high)) {
    throw std::invalid_argument(
        fmt::format("thresholds: tau_low <= tau_high must hold, got tau_low {} and tau_high {}{}", t.tau_low,
                    t.tau_high, t.tau_low > t.tau_high ? ", which seem to be exchanged" : ""));
  }
  require(t.delta >= 0 && t.delta < 1, "0 <= delta < 1", t.delta);
  require(t.gain_window >= 1, "gain_window >= 1", t.gain_window);
  require(t.iterations_min >= 1, "iterations_min >= 1", t.iterations_min);
  require(t.iterations_min <= t.iterations_max, "iterations_min <= iterations_max", t.iterations_max);
  require(t.stop_below >= 0, "0 <= stop_below", t.stop_below);
  require(t.stop_below <= t.tau_low, "stop_below <= tau_low", t.stop_below);
}

Band band(double initial_error, const Thresholds& thresholds) {
  if (initial_error < thresholds.tau_low) return Band::retain;
  if (initial_error < thresholds.tau_high) return Band::refine;
  return Band::discard;
}

bool is_adapted(double initial_error, const Thresholds& thresholds) {
  const Band own = band(initial_error, thresholds);
  return own == Band::refine || (own == Band::retain && thresholds.refine_retained);
}

adaptation::Schedule adaptation_schedule(double initial_error, const Thresholds& thresholds) {
  if (!is_adapted(initial_error, thresholds)) {
    throw std::invalid_argument(fmt::format("L_proj {} lies outside the middle band [{}, {}){}",
                                            initial_error, thresholds.tau_low, thresholds.tau_high,
                                            thresholds.refine_retained ? " and not below it" : ""));
  }
  adaptation::Schedule schedule;
  schedule.iterations = thresholds.iterations_min;
  schedule.stop_below = thresholds.stop_below;
  schedule.gain_window = thresholds.gain_window;
  if (band(initial_error, thresholds) == Band::retain) return schedule;
  const double position = (initial_error - thresholds.tau_low) / (thresholds.tau_high - thresholds.tau_low);
  const int range = thresholds.iterations_max - thresholds.iterations_min;
  schedule.iterations = static_cast<int>(std::lround(thresholds.iterations_min + range * position));
  schedule.min_gain = thresholds.delta;
  return schedule;
}

Judgement judge_initial(double initial_error, const Thresholds& thresholds) {
  if (!std::isfinite(initial_error)) return not_finite("L_proj of the prediction is not finite");
  Judgement judgement;
  judgement.initial_error = initial_error;
  judgement.final_error = initial_error;
  switch (band(initial_error, thresholds)) {
    case Band::retain:
      judgement.verdict = Verdict::retained;
      break;
    case Band::refine:
      judgement.verdict = Verdict::discarded;
      judgement.reason = Reason::gain_too_small;
      judgement.detail =
          fmt::format("L_proj {:.4g} lies in the middle band and was not adapted", initial_error);
      break;
    case Band::discard:
      judgement.verdict = Verdict::discarded;
      judgement.reason = Reason::error_too_large;
      judgement.detail = fmt::format("L_proj {:.4g}, tau_high {:.4g}", initial_error, thresholds.tau_high);
      break;
  }
  return judgement;
}

Judgement judge_adapted(std::span<const double> curve, const Thresholds& thresholds) {
  if (const auto failure = find_failure(curve)) return *failure;
  return judge_iterate(curve, best_iterate(curve), thresholds);
}

Judgement judge_held_out(std::span<const double> curve, std::span<const double> held_out,
                         const Thresholds& thresholds) {
  if (const auto failure = find_failure("judge_held_out", curve, held_out)) return *failure;
  const std::size_t best = best_iterate(held_out);
  Judgement judgement = judge_iterate(curve, best, thresholds);
  if (judgement.verdict == Verdict::refined && best == 0) {
    judgement.verdict = Verdict::discarded;
    judgement.reason = Reason::held_out_not_better;
    judgement.detail = fmt::format("no iterate brings the held-out keypoints below {:.4g}", held_out[0]);
  }
  return judgement;
}

Judgement judge_retained(std::span<const double> curve, std::span<const double> chosen_by,
                         const Thresholds& thresholds) {
  if (const auto failure = find_failure("judge_retained", curve, chosen_by)) return *failure;
  const std::size_t best = best_iterate(chosen_by);
  Judgement judgement = describe(curve, best, thresholds);
  judgement.verdict = best == 0 ? Verdict::retained : Verdict::refined;
  return judgement;
}

}  // namespace q3d::filters
