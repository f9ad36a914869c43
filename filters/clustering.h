// k-means and the adjusted Rand index, which measure whether predicted shapes group by family. Paper section
// "Metrics".
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace q3d::filters {

struct KMeansOptions {
  int clusters = 5;
  std::uint64_t seed = 0;
  int restarts = 10;
  int iterations_max = 300;
};

// points: N x dimensions, row-major. Returns the cluster of each point, 0 .. clusters - 1. Uses Lloyd's
// iterations from k-means++ starts and takes the restart with the least sum of squared distances. The same
// seed gives the same result on every machine. Throws std::invalid_argument for sizes that do not match,
// fewer points than clusters, or a number that is not finite.
std::vector<int> k_means(std::span<const float> points, int dimensions, const KMeansOptions& options);

// Returns the agreement of two partitions of the same items, corrected for chance (Hubert and Arabie 1985).
// It is 1 for equal partitions whatever their labels, and its expected value is 0 for independent ones.
// Throws std::invalid_argument for unequal or zero lengths.
double adjusted_rand_index(std::span<const int> a, std::span<const int> b);

}  // namespace q3d::filters
