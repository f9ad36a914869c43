// Decides which sample is drawn when. This is weighted sampling with replacement over pools, as a function of
// the position alone.
#pragma once

#include <cstdint>
#include <vector>

namespace q3d::pipeline::feed {

struct PoolShare {
  std::int64_t samples = 0;
  double weight = 1.0;  // weight of each sample, as in the official WeightedRandomSampler
};

struct Draw {
  std::size_t pool = 0;
  std::int64_t sample = 0;  // within the pool
  std::uint64_t seed = 0;   // for the sample's augmentation
};

// Each draw depends on seed and position only, so a run can resume at any position, and the number of threads
// does not matter.
class DrawSequence {
 public:
  // Throws std::invalid_argument when nothing can be drawn or a weight is not a finite number >= 0.
  DrawSequence(const std::vector<PoolShare>& pools, std::uint64_t seed);

  Draw at(std::int64_t position) const;

 private:
  std::vector<PoolShare> pools_;
  std::vector<double> cumulative_;  // upper end of each pool's part of [0, 1)
  std::uint64_t seed_;
};

}  // namespace q3d::pipeline::feed
