#include "filters/calibrate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace q3d::filters {
namespace {

void check_input(std::span<const CalibrationSample> pool, const TargetShares& shares) {
  if (pool.empty()) throw std::invalid_argument("calibrate: the pool is empty");
  for (const CalibrationSample& sample : pool) {
    if (!std::isfinite(sample.initial_error) || sample.initial_error < 0) {
      throw std::invalid_argument("calibrate: got an initial error of " +
                                  std::to_string(sample.initial_error) +
                                  ", expected finite numbers of 0 or more");
    }
  }
  if (!(shares.retained > 0 && shares.refined > 0 && shares.retained + shares.refined < 1)) {
    throw std::invalid_argument("calibrate: the shares must be above 0 and together below 1, got retained " +
                                std::to_string(shares.retained) + " and refined " +
                                std::to_string(shares.refined));
  }
}

// Returns a threshold above exactly the first `cut` of the ascending errors.
double threshold_at(const std::vector<CalibrationSample>& sorted, std::size_t cut) {
  if (cut == sorted.size()) {
    return std::nextafter(sorted.back().initial_error, std::numeric_limits<double>::infinity());
  }
  const double above = sorted[cut].initial_error;
  if (cut == 0) return above;
  const double below = sorted[cut - 1].initial_error;
  const double middle = below + (above - below) / 2;
  return middle > below ? middle : above;
}

// Returns the cuts from `first` on that a positive threshold can make: not between equal errors, and not
// below an error of 0.
std::vector<std::size_t> possible_cuts(const std::vector<CalibrationSample>& sorted, std::size_t first) {
  std::vector<std::size_t> cuts;
  for (std::size_t cut = first; cut <= sorted.size(); ++cut) {
    const bool ends = cut == sorted.size();
    const bool parts = !ends && (cut == 0 ? sorted[0].initial_error > 0
                                          : sorted[cut - 1].initial_error < sorted[cut].initial_error);
    if (ends || parts) cuts.push_back(cut);
  }
  return cuts;
}

}  // namespace

Calibration calibrate(std::span<const CalibrationSample> pool, const TargetShares& shares,
                      const Thresholds& base) {
  check_input(pool, shares);
  std::vector<CalibrationSample> sorted(pool.begin(), pool.end());
  std::sort(sorted.begin(), sorted.end(),
            [](const auto& a, const auto& b) { return a.initial_error < b.initial_error; });
  const auto count = static_cast<double>(sorted.size());
  std::vector<double> passing(sorted.size() + 1);  // [i]: number of the first i samples that pass adaptation
  for (std::size_t i = 0; i < sorted.size(); ++i)
    passing[i + 1] = passing[i] + (sorted[i].passes_adaptation ? 1 : 0);

  // Find the cut whose yield is closest to the wanted one; the lowest if several are equally close.
  const auto closest = [&](std::size_t first, double wanted, auto yield) {
    const std::vector<std::size_t> cuts = possible_cuts(sorted, first);
    return *std::min_element(cuts.begin(), cuts.end(), [&](std::size_t a, std::size_t b) {
      return std::abs(yield(a) - wanted) < std::abs(yield(b) - wanted);
    });
  };
  const double retained_target = shares.retained * count;
  const double refined_target = shares.refined * count;
  const std::size_t low =
      closest(0, retained_target, [](std::size_t cut) { return static_cast<double>(cut); });
  const auto refined_at = [&](std::size_t cut) { return passing[cut] - passing[low]; };
  const std::size_t high = closest(low, refined_target, refined_at);
  const auto retained = static_cast<double>(low);
  const double refined = refined_at(high);

  Calibration result;
  result.thresholds = base;
  result.thresholds.tau_low = threshold_at(sorted, low);
  result.thresholds.tau_high = threshold_at(sorted, high);
  check(result.thresholds);
  result.retained = retained / count;
  result.refined = refined / count;
  result.discarded = (count - retained - refined) / count;
  result.reached = std::abs(retained - retained_target) <= 1.0 && std::abs(refined - refined_target) <= 1.0;
  return result;
}

}  // namespace q3d::filters
