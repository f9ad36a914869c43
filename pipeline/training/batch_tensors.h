// Converts the feed's arrays to the tensors that the trainers take.
#pragma once

#include "model/learner.h"
#include "pipeline/feed/feed.h"

namespace q3d::pipeline::training {

// Returns CPU tensors over the batch's arrays, which the tensors keep alive.
model::TrainingBatch to_tensors(feed::FeedBatch&& from);

}  // namespace q3d::pipeline::training
