// `inspect`: what a dataset or a shard holds.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <filesystem>
#include <string>
#include <vector>

#include "manifests/shard.h"

namespace q3d::pipeline::dataset {

// Everything that dataset.json says of a dataset, with its folder; or the header and the samples of a single
// shard. Throws std::runtime_error when `path` is neither.
nlohmann::ordered_json describe(const std::filesystem::path& path);

struct FoundSample {
  std::filesystem::path shard;
  manifests::ShardSample sample;
};
// The sample with this id, of a dataset or of a single shard. Throws std::runtime_error when the id is not
// there, or was not kept.
FoundSample find_sample(const std::filesystem::path& path, const std::string& id);

// Everything that is stored of one sample but its picture. Throws like find_sample.
nlohmann::ordered_json describe_sample(const std::filesystem::path& path, const std::string& id);

// The same for people: a page of at most some sixty lines. They throw like the functions above.
std::string page(const std::filesystem::path& path);
std::string sample_page(const std::filesystem::path& path, const std::string& id);

// `count` samples spread evenly over the dataset's rows (all, when there are fewer).
std::vector<manifests::ShardSample> spread_samples(const std::filesystem::path& path, int count);

}  // namespace q3d::pipeline::dataset
