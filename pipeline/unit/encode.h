// The step that encodes the stored crops of the candidates that the verdicts keep.
#pragma once

#include "pipeline/config/build_config.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// Encodes, in parallel, the stored crops of the kept candidates that have none in work.crops yet, and adds
// them there in the order of the candidates. Frees work.decoded. Does nothing if the unit's shard exists
// already. Needs the judgements, and the pixels from decode_unit. Throws std::runtime_error that names a
// picture that could be read for its prediction but cannot be read now, because a label must not be written
// without its picture.
void encode_crops(UnitWork& work, const config::ShardConfig& shards);

}  // namespace q3d::pipeline::unit
