#include "pipeline/feed/draw_sequence.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "manifests/random.h"

namespace q3d::pipeline::feed {

DrawSequence::DrawSequence(const std::vector<PoolShare>& pools, std::uint64_t seed)
    : pools_(pools), seed_(seed) {
  double total = 0.0;
  for (const PoolShare& pool : pools_) {
    if (!std::isfinite(pool.weight) || pool.weight < 0.0 || pool.samples < 0) {
      throw std::invalid_argument("a pool's weight must be a finite number of at least 0");
    }
    total += pool.weight * static_cast<double>(pool.samples);
  }
  if (total <= 0.0) throw std::invalid_argument("the pools hold no sample with a weight above 0");
  double sum = 0.0;
  for (const PoolShare& pool : pools_) {
    sum += pool.weight * static_cast<double>(pool.samples);
    cumulative_.push_back(sum / total);
  }
}

Draw DrawSequence::at(std::int64_t position) const {
  manifests::Rng random(seed_, {static_cast<std::uint64_t>(position)});
  const double point = random.uniform();
  // Find the first pool whose part ends above the point. A pool without weight has no part.
  const auto end = std::upper_bound(cumulative_.begin(), cumulative_.end(), point);
  Draw draw;
  draw.pool = static_cast<std::size_t>(end - cumulative_.begin());
  const std::int64_t samples = pools_[draw.pool].samples;
  draw.sample =
      std::min(static_cast<std::int64_t>(random.uniform() * static_cast<double>(samples)), samples - 1);
  draw.seed = random.next();
  return draw;
}

}  // namespace q3d::pipeline::feed
