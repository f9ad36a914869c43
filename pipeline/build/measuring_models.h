// Loads what the guards' bounds measure with.
#pragma once

#include "pipeline/config/build_config.h"
#include "pipeline/unit/label_measurer.h"

namespace q3d::pipeline::build {

// Loads the body model and the priors where a bound that is on needs them, and gives the calling thread the
// network's compute threads. Throws std::runtime_error naming the file, and `guards.priors` when it holds no
// priors.
unit::MeasuringModels load_measuring_models(const config::BuildConfig& config);

}  // namespace q3d::pipeline::build
