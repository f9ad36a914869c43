// The trust scores of a label as one number.
#pragma once

#include "manifests/verdict.h"

namespace q3d::filters {

// Raise it when the weights change: it is part of the shards' key.
inline constexpr int kTrustVersion = 1;

// Returns how far a label can be trusted, from 0 to 1, 1 = most, by a logistic function of weighted scores.
// The weights are a first guess and not fitted yet, so the number orders labels and is no probability. A
// score that is NaN counts as average. Returns NaN for a judgement that keeps no label or of which nothing
// was measured.
double combined_trust(const manifests::Judgement& judgement);

}  // namespace q3d::filters
