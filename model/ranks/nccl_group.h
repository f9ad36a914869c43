// NCCL, by which GPUs exchange tensors without the host; for the sources of this room alone.
#pragma once

#include <torch/types.h>

#include <torch/csrc/distributed/c10d/Backend.hpp>
#include <torch/csrc/distributed/c10d/Store.hpp>

#include "model/ranks/rank_place.h"

namespace q3d::model::ranks {

// Returns whether this rank can use NCCL: the program was built with it, the device is a GPU, and the machine
// has a GPU for each of its ranks, since NCCL refuses two ranks on one.
bool can_use_nccl(const RankPlace& place, torch::Device device);

// Connects this rank with the others, all of which must call it. Throws std::runtime_error if the program was
// built without NCCL, or c10::Error if there is no GPU.
c10::intrusive_ptr<c10d::Backend> open_nccl(const RankPlace& place,
                                            const c10::intrusive_ptr<c10d::Store>& store);

}  // namespace q3d::model::ranks
