// Shards with seeded pictures and labels.
#pragma once

#include <filesystem>
#include <string>

#include "manifests/shard.h"

namespace q3d::testing {

// A sample with a seeded picture of 320 x 240 px, its box inside, every keypoint labelled; with a body or,
// where `labelled` is false, 2D keypoints only.
manifests::ShardSample shard_sample(const std::string& id, unsigned seed, bool labelled);

// `count` samples "<name>/0", "<name>/1", ... in one PNG shard; the odd ones have keypoints only.
void write_sample_shard(const std::filesystem::path& path, const std::string& name, int count, unsigned seed);

}  // namespace q3d::testing
