// Writes the synthetic quadruped and its priors as files, in the forms that the toolkit reads.
#pragma once

#include <filesystem>

#include "model/priors.h"

namespace q3d::pipeline::animal {

// Writes the asset of make_synthetic_quadruped(). Throws std::runtime_error.
void write_synthetic_asset(const std::filesystem::path& path);

// Returns the pose and shape priors in the network's form, and writes them to a file under the official
// names. Writing throws std::runtime_error.
model::Priors synthetic_priors();
void write_synthetic_priors(const std::filesystem::path& path);

}  // namespace q3d::pipeline::animal
