// Connects several ranks over the network with LibTorch's own c10d.
#pragma once

#include <torch/types.h>

#include <memory>

#include "model/ranks/collective.h"
#include "model/ranks/rank_place.h"

namespace q3d::model::ranks {

// Meets the other ranks; blocks until all have come. single_rank() in a world of one. Tensors may be on the
// CPU or on `device`. Throws std::runtime_error when the ranks do not meet in time.
std::shared_ptr<const Collective> join_ranks(const RankPlace& place, torch::Device device);

}  // namespace q3d::model::ranks
