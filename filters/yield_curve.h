// The yield of a threshold on the initial error, and how good the samples are that it lets through.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace q3d::filters {

struct ScoredSample {
  double initial_error = 0.0;  // L_proj of the prediction, crop units
  double auc = 0.0;            // AUC of the prediction, percent
};

struct YieldPoint {
  double tau = 0.0;
  double yield = 0.0;  // share of the pool with an initial error below tau
  double auc = 0.0;    // mean AUC of these samples, percent; NaN if there are none
};

// Throws std::invalid_argument for an empty pool.
YieldPoint yield_at(std::span<const ScoredSample> pool, double tau);

// Returns `points` points at equal steps of yield up to 1, in ascending tau, or fewer if the pool is smaller
// or errors are equal. Each tau is the least number above the largest error that it lets through. Throws
// std::invalid_argument for an empty pool, no points, or numbers that are not finite.
std::vector<YieldPoint> yield_curve(std::span<const ScoredSample> pool, std::size_t points);

}  // namespace q3d::filters
