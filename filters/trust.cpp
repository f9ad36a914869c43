#include "filters/trust.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "manifests/enumerators.h"

namespace q3d::filters {
namespace {

using manifests::Judgement;

// One number of a label, brought to mean 0 and deviation 1 on the world of the fit.
struct Term {
  double (*value)(const Judgement&);
  double mean;
  double deviation;
  double weight;  // of the log odds of a good label
};

// Ratios and distances have long tails, which their logarithms do not have.
double log_of(double value) {
  return std::log(std::max(value, 1e-6));
}

// A first guess: equal weights, and means and deviations of the order that the scores have on the rendered
// world. `tools/trust_scores.py --fit` fits them to a pool whose truth is known.
constexpr double kBias = 1.1;
const std::array<Term, 4> kTerms{{
    {[](const Judgement& j) { return log_of(j.trust.mirror); }, 4.0, 0.4, -0.5},
    {[](const Judgement& j) { return log_of(j.trust.aux_2d); }, -3.5, 0.4, -0.5},
    {[](const Judgement& j) { return j.trust.pose_prior; }, 1.5, 0.4, -0.5},
    {[](const Judgement& j) { return log_of(j.initial_error); }, -3.0, 0.4, -0.5},
}};

}  // namespace

double combined_trust(const Judgement& judgement) {
  if (!manifests::is_kept(judgement.verdict) || std::isnan(judgement.trust.visible)) {
    return manifests::TrustScores::kNotMeasured;
  }
  double log_odds = kBias;
  for (const Term& term : kTerms) {
    const double value = term.value(judgement);
    if (std::isfinite(value)) log_odds += term.weight * (value - term.mean) / term.deviation;
  }
  return 1.0 / (1.0 + std::exp(-log_odds));
}

}  // namespace q3d::filters
