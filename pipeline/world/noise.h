// Makes smooth random fields for coats, ground and foliage.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>

namespace q3d::pipeline::world {

// Value noise on the integer lattice, smooth between lattice points, with period 256. One field serves the
// whole world; pictures use different places of it.
class NoiseField {
 public:
  explicit NoiseField(std::uint64_t seed);

  float at(float x, float y) const;          // [-1, 1]
  float at(const Eigen::Vector3f& p) const;  // [-1, 1]
  // Returns a sum of octaves, each with twice the frequency and half the height of the previous one; about
  // [-1, 1].
  float octaves(float x, float y, int count) const;
  float octaves(const Eigen::Vector3f& p, int count) const;

  struct Cell {
    float nearest = 0.0F;     // distance to the nearest feature point, in lattice steps
    std::uint32_t label = 0;  // its random number, 0 to 255
  };
  // Computes cellular noise with one jittered feature point for each lattice cube.
  Cell cell(const Eigen::Vector3f& p) const;

 private:
  std::uint8_t hash(int x, int y, int z) const {
    return order_[(order_[(order_[x & 255] + y) & 255] + z) & 255];
  }
  std::array<std::uint8_t, 256> order_{};
  std::array<float, 256> value_{};
  std::array<Eigen::Vector3f, 256> jitter_;
};

inline float smooth_step(float low, float high, float x) {
  const float t = std::min(1.0F, std::max(0.0F, (x - low) / (high - low)));
  return t * t * (3.0F - 2.0F * t);
}

}  // namespace q3d::pipeline::world
