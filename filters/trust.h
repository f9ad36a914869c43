// The trust scores of a label as one number.
#pragma once

#include "manifests/verdict.h"

namespace q3d::filters {

// Raise it when the weights change: it is part of the shards' key.
inline constexpr int kTrustVersion = 1;

// Returns how far a label can be trusted, from 0 to 1, 1 = most: the probability of a logistic regression
// that its PA-MPJPE is not among the worst quarter. Its weights were fitted on one rendered world by
// tools/trust_scores.py and are frozen; docs/results.md says what they are worth on other worlds. A score
// that is NaN counts as average. Returns NaN for a judgement that keeps no label or of which nothing was
// measured.
double combined_trust(const manifests::Judgement& judgement);

}  // namespace q3d::filters
