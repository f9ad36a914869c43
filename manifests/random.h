// Random numbers that are the same on every machine and for every number of threads. The standard fixes its
// engines and not its distributions, so the few distributions that are needed are written out here. The
// header is in manifests because that is the lowest folder that all its users may include.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <numbers>
#include <random>

namespace q3d::manifests {

// Returns a number in [0, 1) made of the top 53 of 64 random bits.
inline double unit_interval(std::uint64_t bits) {
  return static_cast<double>(bits >> 11U) * 0x1.0p-53;
}

// Returns a number in [0, 1).
inline double uniform(std::mt19937_64& engine) {
  return unit_interval(engine());
}

// Returns a whole number in 0 .. count - 1. The bias is below count / 2^53.
inline std::size_t uniform_below(std::mt19937_64& engine, std::size_t count) {
  return static_cast<std::size_t>(uniform(engine) * static_cast<double>(count));
}

// The generator SplitMix64 (Steele, Lea, Flood 2014). It adds the step to its state and scrambles the sum.
inline constexpr std::uint64_t kSplitMixStep = 0x9E3779B97F4A7C15ULL;
inline std::uint64_t scramble(std::uint64_t z) {
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31U);
}

// SplitMix64 with the distributions that the synthetic world and the draws of training need.
class Rng {
 public:
  explicit Rng(std::uint64_t seed) : state_(seed) {}
  // Every key gives an independent stream, so that one more draw in one place does not change the others.
  Rng(std::uint64_t seed, std::initializer_list<std::uint64_t> key) : state_(seed) {
    for (const std::uint64_t part : key) state_ = scramble(state_ ^ (part + kSplitMixStep));
  }

  std::uint64_t next() { return scramble(state_ += kSplitMixStep); }
  double uniform() { return unit_interval(next()); }  // [0, 1)
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  bool chance(double probability) { return uniform() < probability; }
  // Returns an integer in [0, count).
  int below(int count) { return static_cast<int>(uniform() * count); }

  // Returns a standard normal number (Box-Muller). The second number of each pair is left unused, which keeps
  // the state one word.
  double normal() {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    return radius * std::cos(2.0 * std::numbers::pi * uniform());
  }
  double normal(double mean, double deviation) { return mean + deviation * normal(); }

 private:
  std::uint64_t state_;
};

}  // namespace q3d::manifests
