// The trust scores of a label as one number.
#pragma once

#include "manifests/verdict.h"

namespace q3d::filters {

// Raise it when the weights change: it is part of the shards' key.
inline constexpr int kTrustVersion = 2;

// Returns how far a label can be trusted, from 0 to 1, 1 = most: the chance that its PA-MPJPE is at most 119
// mm, which three quarters of the labels reach in the rendered world of the fit. It is a logistic function of
// weighted scores. Retained labels have other weights than refined ones, because L_proj says something else
// after adaptation. With another network or with photographs the number still orders labels, but is no
// probability. A score that is NaN counts as average. Returns NaN for a judgement that keeps no label or of
// which nothing was measured.
double combined_trust(const manifests::Judgement& judgement);

}  // namespace q3d::filters
