// Random numbers of the synthetic world: the same on every machine and for every number of threads.
#pragma once

#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <numbers>

namespace q3d::pipeline::run {

// SplitMix64. The standard library's distributions differ between implementations, so the few that are needed
// are written out here.
class Rng {
 public:
  explicit Rng(std::uint64_t seed) : state_(seed) {}
  // A stream of its own for every key, so that one more draw in one place disturbs no other.
  Rng(std::uint64_t seed, std::initializer_list<std::uint64_t> key) : state_(seed) {
    for (const std::uint64_t part : key) state_ = scramble(state_ ^ (part + kStep));
  }

  std::uint64_t next() { return scramble(state_ += kStep); }
  double uniform() { return static_cast<double>(next() >> 11U) * 0x1.0p-53; }  // [0, 1)
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  bool chance(double probability) { return uniform() < probability; }
  // An integer in [0, count).
  int below(int count) { return static_cast<int>(uniform() * count); }

  // Standard normal (Box-Muller; the second number of each pair is left unused to keep the state one word).
  double normal() {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    return radius * std::cos(2.0 * std::numbers::pi * uniform());
  }
  double normal(double mean, double deviation) { return mean + deviation * normal(); }

 private:
  static constexpr std::uint64_t kStep = 0x9E3779B97F4A7C15ULL;
  static std::uint64_t scramble(std::uint64_t z) {
    z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31U);
  }
  std::uint64_t state_;
};

}  // namespace q3d::pipeline::run
