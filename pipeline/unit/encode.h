// The step that encodes the stored crops of the candidates that the verdicts keep.
#pragma once

#include "pipeline/config/build_config.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// Encodes, in parallel, the stored crops of the kept candidates that have none in work.crops yet, and adds
// them there in the order of the candidates. Frees work.decoded. Does nothing where the unit's shard is there
// already. Needs the judgements, and the pixels that decode_unit left. Throws std::runtime_error that names a
// picture which could be read when it was predicted and cannot be read now: a label without its picture must
// not be written.
void encode_crops(UnitWork& work, const config::ShardConfig& shards);

}  // namespace q3d::pipeline::unit
