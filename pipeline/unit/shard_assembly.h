// A judged unit -> the samples of its shard.
#pragma once

#include <vector>

#include "manifests/shard.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// Returns the kept candidates of the unit in ingest order. Takes the bytes of their stored crops out of
// work.crops. Needs predicted, refined, judgements and the crop of every kept candidate; throws
// std::logic_error where one is missing.
std::vector<manifests::ShardSample> shard_samples(UnitWork& work);

}  // namespace q3d::pipeline::unit
