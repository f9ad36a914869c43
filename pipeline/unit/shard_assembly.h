// A judged unit -> the samples of its shard.
#pragma once

#include <vector>

#include "manifests/shard.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// The kept candidates of the unit in ingest order. Needs predicted, refined, judgements and, for every kept
// candidate, its decoded picture.
std::vector<manifests::ShardSample> shard_samples(const UnitWork& work);

}  // namespace q3d::pipeline::unit
