#include "filters/trust.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "manifests/enumerators.h"

namespace q3d::filters {
namespace {

using manifests::Judgement;

// One number of a label, brought to mean 0 and deviation 1 on the world of the fit.
struct Term {
  double (*value)(const Judgement&);
  double mean;
  double deviation;
  double weight;  // weight of the term in the log odds of a good label
};

// Ratios and distances have long tails, which their logarithms do not have.
double log_of(double value) {
  return std::log(std::max(value, 1e-6));
}

double log_initial_error(const Judgement& judgement) {
  return log_of(judgement.initial_error);
}

// Both sets of weights are the output of `tools/trust_scores.py --fit` on 700 pictures of a rendered world
// that nothing else is measured on (docs/evaluation.md has the command).
constexpr double kRetainedBias = 0.8644;
const std::array<Term, 1> kRetained{{{log_initial_error, -3.194, 0.1875, -0.6935}}};

constexpr double kRefinedBias = 2.326;
const std::array<Term, 4> kRefined{{
    {log_initial_error, -3.019, 0.2479, -0.6541},
    {[](const Judgement& j) { return log_of(j.trust.aux_2d); }, -3.628, 0.3163, -0.4351},
    {[](const Judgement& j) { return j.gain; }, 0.5484, 0.111, 0.4298},
    {[](const Judgement& j) { return j.trust.visible; }, 15.93, 3.491, 0.3728},
}};

double log_odds(const Judgement& judgement, double bias, std::span<const Term> terms) {
  for (const Term& term : terms) {
    const double value = term.value(judgement);
    if (std::isfinite(value)) bias += term.weight * (value - term.mean) / term.deviation;
  }
  return bias;
}

}  // namespace

double combined_trust(const Judgement& judgement) {
  if (!manifests::is_kept(judgement.verdict) || std::isnan(judgement.trust.visible)) {
    return manifests::TrustScores::kNotMeasured;
  }
  const double odds = judgement.verdict == manifests::Verdict::retained
                          ? log_odds(judgement, kRetainedBias, kRetained)
                          : log_odds(judgement, kRefinedBias, kRefined);
  return 1.0 / (1.0 + std::exp(-odds));
}

}  // namespace q3d::filters
