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

// The same for two methods that choose their items, such as labels that two builds keep: the mean of the
// second set minus that of the first. first, second: runs x items, row-major, the item's value under either
// method; NaN where it is not in the set.
//
// Pictures and runs are drawn as above, the same for both sets; a resample's difference is that of the two
// means over all drawn members, so the interval knows that a picture that is easy for one method is easy for
// the other. It takes the sets as given: what chose them is not repeated. A resample that misses one of the
// sets altogether is drawn again.
//
// Throws std::invalid_argument as paired_bootstrap does, for infinite values, and when a set is empty.
BootstrapInterval bootstrap_of_sets(std::span<const double> first, std::span<const double> second,
                                    std::span<const std::size_t> picture_of_item,
                                    const BootstrapOptions& options);

}  // namespace q3d::filters
