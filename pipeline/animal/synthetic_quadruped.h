// A synthetic quadruped with SMAL's dimensions, because SMAL itself cannot be redistributed.
#pragma once

#include <array>

#include "smal/tensors/asset.h"

namespace q3d::pipeline::animal {

// Returns a closed animal (legs, tail, head, ears) with 3889 vertices, 7774 faces, 35 joints, 41 shape and
// 306 pose blend shapes. It is left-right symmetric, and every call returns the same numbers.
smal::tensors::SmalAsset make_synthetic_quadruped();

// These return the betas at the centre of each of the five families (Felidae, Canidae, Equidae, Bovidae,
// Hippopotamidae), (5, 41), and the standard deviation of each beta inside a family, (41). Both are float32.
torch::Tensor synthetic_family_means();
torch::Tensor synthetic_betas_std();

}  // namespace q3d::pipeline::animal
