// A counter-based generator and uniform draws only: library normal distributions go through vectorised
// logarithms that differ between CPUs.
#include "model/seeded_uniform.h"

#include "manifests/random.h"

namespace q3d::model {
namespace {

std::uint64_t mix(std::uint64_t x) {
  return manifests::scramble(x + manifests::kSplitMixStep);
}

std::uint64_t stream_of(std::uint64_t seed, std::string_view name) {
  std::uint64_t hash = mix(seed);
  for (const char c : name) hash = mix(hash ^ static_cast<unsigned char>(c));
  return hash;
}

}  // namespace

void fill_uniform(torch::Tensor& tensor, double bound, std::uint64_t seed, std::string_view name) {
  const std::uint64_t stream = stream_of(seed, name);
  float* values = tensor.data_ptr<float>();
  for (std::int64_t i = 0; i < tensor.numel(); ++i) {
    const double unit = manifests::unit_interval(mix(stream + static_cast<std::uint64_t>(i)));
    values[i] = static_cast<float>((2.0 * unit - 1.0) * bound);
  }
}

}  // namespace q3d::model
