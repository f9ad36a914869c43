// The synthetic quadruped and its priors as files, in the forms that the toolkit reads.
#pragma once

#include <filesystem>

#include "model/priors.h"

namespace q3d::pipeline::animal {

// Its asset (make_synthetic_quadruped). Throws std::runtime_error.
void write_synthetic_asset(const std::filesystem::path& path);

// Its pose and shape priors in the network's form, and a file of them under the official names. Writing
// throws std::runtime_error.
model::Priors synthetic_priors();
void write_synthetic_priors(const std::filesystem::path& path);

}  // namespace q3d::pipeline::animal
