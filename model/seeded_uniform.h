// Uniform random numbers that are the same on every machine.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <string_view>

namespace q3d::model {

// Fills a float32 CPU tensor with numbers in [-bound, bound). Each name is a stream of its own, and element i
// depends on seed, name and i alone.
void fill_uniform(torch::Tensor& tensor, double bound, std::uint64_t seed, std::string_view name);

}  // namespace q3d::model
