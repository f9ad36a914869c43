// Seeded fresh weights, for tests, benchmarks and training from scratch.
#pragma once

#include <torch/types.h>

#include <cstdint>

#include "model/checkpoint.h"
#include "model/net.h"

namespace q3d::model {

// Returns the initial float32 values of one tensor. They depend only on its name, its shape and the seed, and
// are the same on every machine. Norms start at one and zero, init_pose at the identity, init_cam at the
// official camera, biases at zero, matrices and embeddings uniform.
torch::Tensor initial_tensor(const TensorSpec& spec, std::uint64_t seed);

// Gives every parameter its initial values, in place.
void initialise(PrimaNet& net, std::uint64_t seed);

}  // namespace q3d::model
