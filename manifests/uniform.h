// Uniform random numbers that are the same on every machine: the standard's engines are, its distributions
// are not. It stands here because manifests is the lowest room that both loaders and filters see.
#pragma once

#include <cstddef>
#include <random>

namespace q3d::manifests {

// A number in [0, 1) of 53 random bits.
inline double uniform(std::mt19937_64& engine) {
  return static_cast<double>(engine() >> 11U) * 0x1.0p-53;
}

// A whole number in 0 .. count - 1. The bias is below count / 2^53.
inline std::size_t uniform_below(std::mt19937_64& engine, std::size_t count) {
  return static_cast<std::size_t>(uniform(engine) * static_cast<double>(count));
}

}  // namespace q3d::manifests
