#include "filters/yield_curve.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace q3d::filters {

YieldPoint yield_at(std::span<const ScoredSample> pool, double tau) {
  if (pool.empty()) throw std::invalid_argument("yield_at: the pool is empty");
  std::size_t count = 0;
  double sum = 0.0;
  for (const ScoredSample& sample : pool) {
    if (!(sample.initial_error < tau)) continue;
    ++count;
    sum += sample.auc;
  }
  const double auc = count == 0 ? std::numeric_limits<double>::quiet_NaN() : sum / static_cast<double>(count);
  return {tau, static_cast<double>(count) / static_cast<double>(pool.size()), auc};
}

std::vector<YieldPoint> yield_curve(std::span<const ScoredSample> pool, std::size_t points) {
  if (pool.empty() || points == 0) {
    throw std::invalid_argument("yield_curve: expected samples and points, got none");
  }
  std::vector<ScoredSample> sorted(pool.begin(), pool.end());
  for (const ScoredSample& sample : sorted) {
    if (!std::isfinite(sample.initial_error) || !std::isfinite(sample.auc)) {
      throw std::invalid_argument("yield_curve: an error or AUC of the pool is not finite");
    }
  }
  std::sort(sorted.begin(), sorted.end(),
            [](const ScoredSample& a, const ScoredSample& b) { return a.initial_error < b.initial_error; });
  std::vector<YieldPoint> curve;
  double sum = 0.0;
  std::size_t next = 1;  // the step that has not been reached
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    sum += sorted[i].auc;
    const std::size_t count = i + 1;
    const bool parts = count == sorted.size() || sorted[i].initial_error < sorted[count].initial_error;
    if (!parts || count * points < next * sorted.size()) continue;
    next = count * points / sorted.size() + 1;
    const double tau = std::nextafter(sorted[i].initial_error, std::numeric_limits<double>::infinity());
    const auto through = static_cast<double>(count);
    curve.push_back({tau, through / static_cast<double>(sorted.size()), sum / through});
  }
  return curve;
}

}  // namespace q3d::filters
