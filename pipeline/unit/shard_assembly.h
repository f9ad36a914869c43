// Makes the samples of a shard from a judged unit.
#pragma once

#include <vector>

#include "manifests/shard.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// Returns the kept candidates of the unit in ingest order. Takes the bytes of their stored crops out of
// work.crops. Needs predicted, refined, judgements and the crop of every kept candidate; throws
// std::logic_error if one is missing.
std::vector<manifests::ShardSample> shard_samples(UnitWork& work);

}  // namespace q3d::pipeline::unit
