// The feed's arrays as the trainers take them.
#pragma once

#include "model/learner.h"
#include "pipeline/feed/feed.h"

namespace q3d::pipeline::training {

// Returns tensors over the batch's arrays, which they keep alive, on the CPU.
model::TrainingBatch to_tensors(feed::FeedBatch&& from);

}  // namespace q3d::pipeline::training
