// Checks, before ranks train together, that they mean the same run.
#pragma once

#include <string>

#include "model/ranks/collective.h"
#include "pipeline/training/training_state.h"

namespace q3d::pipeline::training {

// Throws ConfigError on every rank, naming the first rank that differs from rank 0, unless all ranks have the
// same key of configuration, pools and assets (64 characters) and resume from the same state. Blocks until
// all ranks call it.
void require_same_run(const model::ranks::Collective& ranks, const std::string& key,
                      const TrainingPosition& position);

}  // namespace q3d::pipeline::training
