#include "pipeline/training/draw_sequence.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace q3d::pipeline {
namespace {

std::uint64_t mix(std::uint64_t x) {  // the finaliser of SplitMix64 (Steele, Lea, Flood 2014)
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

double unit(std::uint64_t bits) {  // [0, 1)
  return static_cast<double>(bits >> 11) * 0x1p-53;
}

}  // namespace

DrawSequence::DrawSequence(const std::vector<PoolShare>& pools, std::uint64_t seed)
    : pools_(pools), seed_(mix(seed)) {
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
  const std::uint64_t base = mix(seed_ ^ static_cast<std::uint64_t>(position));
  const double point = unit(mix(base));
  // The first pool whose part ends above the point; pools without weight have no part.
  const auto end = std::upper_bound(cumulative_.begin(), cumulative_.end(), point);
  Draw draw;
  draw.pool = static_cast<std::size_t>(end - cumulative_.begin());
  const std::int64_t samples = pools_[draw.pool].samples;
  draw.sample =
      std::min(static_cast<std::int64_t>(unit(mix(base + 1)) * static_cast<double>(samples)), samples - 1);
  draw.seed = mix(base + 2);
  return draw;
}

}  // namespace q3d::pipeline
