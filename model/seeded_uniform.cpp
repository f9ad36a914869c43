// A counter-based generator and uniform draws only: library normal distributions go through vectorised
// logarithms that differ between CPUs.
#include "model/seeded_uniform.h"

namespace q3d::model {
namespace {

std::uint64_t mix(std::uint64_t x) {  // the finaliser of SplitMix64 (Steele, Lea, Flood 2014)
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
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
    const double unit = static_cast<double>(mix(stream + static_cast<std::uint64_t>(i)) >> 11) * 0x1p-53;
    values[i] = static_cast<float>((2.0 * unit - 1.0) * bound);
  }
}

}  // namespace q3d::model
