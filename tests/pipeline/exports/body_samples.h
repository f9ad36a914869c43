// Kept samples whose numbers agree with each other, as a build leaves them.
#pragma once

#include <filesystem>
#include <string>

#include "manifests/shard.h"

namespace q3d::testing {

// The share of the source picture's resolution that the stored crop has.
enum class Stored { whole, reduced };

// A retained sample of the dataset zoo/train with a picture, a mask where `seed` is even, keypoints of which
// some are not labelled, and a body. The body's keypoints are projected near the annotated ones, and
// final_error is theirs.
manifests::ShardSample body_sample(const std::string& id, unsigned seed, Stored stored);

// A shard of `count` samples "zoo/train/<name>_<i>.jpg#<i>", whole and reduced ones in turn, as JPEG.
void write_body_shard(const std::filesystem::path& path, const std::string& name, int count, unsigned seed,
                      std::int64_t unit = 0);

}  // namespace q3d::testing
