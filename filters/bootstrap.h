// Paired bootstrap, which tests whether one method is better than another on the same pictures. Efron and
// Tibshirani, An Introduction to the Bootstrap (1993), chapters 8 and 13 (percentile intervals).
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
  double mean = 0.0;  // mean of all differences
  double low = 0.0;   // the interval's ends
  double high = 0.0;
};

// differences: runs x items, row-major. Each is the second minus the first method's value, for one item under
// one pair of runs (a pair of seeds). picture_of_item: the picture of each item; pictures are numbered from 0
// without gaps. Items of one picture are drawn together, because they are not independent.
//
// Each resample draws as many pictures as there are, with replacement, and as many runs, and takes the mean
// difference of the drawn items. The ends of the interval are quantiles of these means, linearly
// interpolated. With one run, only pictures are drawn. The same seed gives the same interval on every
// machine.
//
// Throws std::invalid_argument for sizes that do not match, no items, a number that is not finite, or options
// out of range.
BootstrapInterval paired_bootstrap(std::span<const double> differences,
                                   std::span<const std::size_t> picture_of_item,
                                   const BootstrapOptions& options);

// Computes the same interval for two methods that choose their items, such as the labels that two builds
// keep. The result is the mean of the second set minus that of the first. first, second: runs x items,
// row-major; the item's value under each method, NaN if it is not in the set.
//
// Pictures and runs are drawn as above, the same for both sets. A resample's difference is that of the two
// means over all drawn members, so a picture that is easy for both methods does not widen the interval. The
// sets are taken as given; the choice that made them is not repeated. A resample without any member of one of
// the sets is drawn again.
//
// Throws std::invalid_argument as paired_bootstrap does, for infinite values, and if a set is empty.
BootstrapInterval bootstrap_of_sets(std::span<const double> first, std::span<const double> second,
                                    std::span<const std::size_t> picture_of_item,
                                    const BootstrapOptions& options);

}  // namespace q3d::filters
