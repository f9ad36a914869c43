#include "pipeline/world/noise.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "manifests/random.h"

namespace q3d::pipeline::world {
namespace {

// This replaces std::floor, which is a library call on the oldest supported processors, in the most
// time-critical function.
int floor_of(float x) {
  const int truncated = static_cast<int>(x);
  return truncated - (x < static_cast<float>(truncated) ? 1 : 0);
}

float fade(float t) {
  return t * t * (3.0F - 2.0F * t);
}
float mix(float a, float b, float t) {
  return a + (b - a) * t;
}

}  // namespace

NoiseField::NoiseField(std::uint64_t seed) {
  manifests::Rng rng(seed, {0x6E6F697365});
  std::iota(order_.begin(), order_.end(), std::uint8_t{0});
  for (int i = 255; i > 0; --i) std::swap(order_[i], order_[rng.below(i + 1)]);
  for (float& value : value_) value = static_cast<float>(rng.uniform(-1.0, 1.0));
  for (Eigen::Vector3f& jitter : jitter_) {
    for (int axis = 0; axis < 3; ++axis) jitter[axis] = static_cast<float>(rng.uniform(0.1, 0.9));
  }
}

float NoiseField::at(float x, float y) const {
  const int ix = floor_of(x), iy = floor_of(y);
  const float u = fade(x - static_cast<float>(ix)), v = fade(y - static_cast<float>(iy));
  return mix(mix(value_[hash(ix, iy, 0)], value_[hash(ix + 1, iy, 0)], u),
             mix(value_[hash(ix, iy + 1, 0)], value_[hash(ix + 1, iy + 1, 0)], u), v);
}

float NoiseField::at(const Eigen::Vector3f& p) const {
  const int x = floor_of(p.x()), y = floor_of(p.y()), z = floor_of(p.z());
  const float u = fade(p.x() - static_cast<float>(x)), v = fade(p.y() - static_cast<float>(y)),
              w = fade(p.z() - static_cast<float>(z));
  const auto corner = [&](int dx, int dy, int dz) { return value_[hash(x + dx, y + dy, z + dz)]; };
  const auto layer = [&](int dz) {
    return mix(mix(corner(0, 0, dz), corner(1, 0, dz), u), mix(corner(0, 1, dz), corner(1, 1, dz), u), v);
  };
  return mix(layer(0), layer(1), w);
}

float NoiseField::octaves(float x, float y, int count) const {
  float sum = 0.0F, height = 0.5F;
  for (int octave = 0; octave < count; ++octave, height *= 0.5F) {
    sum += height * at(x, y);
    x = 2.0F * x + 17.3F;
    y = 2.0F * y + 5.7F;
  }
  return 1.5F * sum;
}

float NoiseField::octaves(const Eigen::Vector3f& p, int count) const {
  Eigen::Vector3f q = p;
  float sum = 0.0F, height = 0.5F;
  for (int octave = 0; octave < count; ++octave, height *= 0.5F) {
    sum += height * at(q);
    q = 2.0F * q + Eigen::Vector3f(17.3F, 5.7F, 11.1F);
  }
  return 1.5F * sum;
}

NoiseField::Cell NoiseField::cell(const Eigen::Vector3f& p) const {
  const int x = floor_of(p.x()), y = floor_of(p.y()), z = floor_of(p.z());
  const Eigen::Vector3f inside =
      p - Eigen::Vector3f(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z));
  float nearest = 9.0F;  // squared
  std::uint32_t label = 0;
  for (int dz = -1; dz <= 1; ++dz) {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const std::uint8_t id = hash(x + dx, y + dy, z + dz);
        const Eigen::Vector3f corner(static_cast<float>(dx), static_cast<float>(dy), static_cast<float>(dz));
        const float d = (jitter_[id] + corner - inside).squaredNorm();
        if (d < nearest) {
          nearest = d;
          label = id;
        }
      }
    }
  }
  return {std::sqrt(nearest), label};
}

}  // namespace q3d::pipeline::world
