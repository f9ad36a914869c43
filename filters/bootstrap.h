// Paired bootstrap: is one method better than another on the same pictures? Efron and Tibshirani, An
// Introduction to the Bootstrap (1993), chapters 8 and 13 (percentile intervals).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace q3d::filters {

struct BootstrapOptions {
  int resamples = 10'000;
  double confidence = 0.95;
  std::uint64_t seed = 0;
};

struct BootstrapInterval {
  double mean = 0.0;  // of all differences
  double low = 0.0;   // the interval's ends
  double high = 0.0;
};

// differences: runs x items, row-major: second minus first method, of one item under one pair of runs (a pair
// of seeds). picture_of_item: items numbers from 0, without gaps; items of one picture are drawn together,
// since they are not independent.
//
// Each resample draws as many pictures as there are, with replacement, and as many runs, and takes the mean
// difference of the items so drawn; the interval's ends are quantiles of these means, linearly interpolated.
// With one run, only pictures are drawn. The same seed gives the same interval on every machine.
//
// Throws std::invalid_argument for sizes that do not fit, no items, a number that is not finite, or options
// out of range.
BootstrapInterval paired_bootstrap(std::span<const double> differences,
                                   std::span<const std::size_t> picture_of_item,
                                   const BootstrapOptions& options);

}  // namespace q3d::filters
