// `inspect`: what a dataset or a shard holds.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <filesystem>
#include <string>
#include <vector>

#include "manifests/shard.h"

namespace q3d::pipeline::dataset {

// Name, version, counts, statistics and shards of a dataset; header and samples of a single shard. Throws
// std::runtime_error when `path` is neither.
nlohmann::ordered_json describe(const std::filesystem::path& path);

// Everything that is stored of one sample but its picture. Throws std::runtime_error when the id is not
// there.
nlohmann::ordered_json describe_sample(const std::filesystem::path& path, const std::string& id);

// `count` samples spread evenly over the dataset's rows (all, when there are fewer).
std::vector<manifests::ShardSample> spread_samples(const std::filesystem::path& path, int count);

}  // namespace q3d::pipeline::dataset
