// Implements the body model and reads the priors with LibTorch.
#pragma once

#include <filesystem>
#include <memory>

#include "pipeline/device/body_meshes.h"

namespace q3d::pipeline::network {

// Throws std::runtime_error naming file and tensor.
std::unique_ptr<device::BodyMeshes> load_body_meshes(const std::filesystem::path& smal_asset);

// Returns whether the asset is the synthetic quadruped of the rendered world. Throws likewise.
bool is_synthetic_body(const std::filesystem::path& smal_asset);

// Sets the number of threads, at least 1, that LibTorch operators of the calling thread use from now on.
void use_compute_threads(int threads);

// Reads a file of priors (model/priors.h), or a checkpoint that holds them. Throws std::runtime_error that
// names file and tensor.
device::PriorNumbers read_priors(const std::filesystem::path& path);
// Returns whether the file holds priors at all. Throws std::runtime_error naming the file.
bool has_priors(const std::filesystem::path& path);

}  // namespace q3d::pipeline::network
