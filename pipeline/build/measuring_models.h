// Loads the models with which labels are measured.
#pragma once

#include "pipeline/config/build_config.h"
#include "pipeline/unit/label_measurer.h"

namespace q3d::pipeline::build {

// Loads the body model, and the priors of guards.priors or, where that is empty, of the checkpoint if it
// holds them; gives the calling thread the network's compute threads. Throws std::runtime_error naming the
// file, and `guards.priors` when a bound that is on needs priors and there are none.
unit::MeasuringModels load_measuring_models(const config::BuildConfig& config);

}  // namespace q3d::pipeline::build
