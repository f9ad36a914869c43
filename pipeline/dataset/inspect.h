// `inspect`: shows the content of a dataset or a shard.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <filesystem>
#include <string>
#include <vector>

#include "manifests/shard.h"

namespace q3d::pipeline::dataset {

// Returns everything that dataset.json says about a dataset, with its folder, or the header and the samples
// of a single shard. Throws std::runtime_error if `path` is neither.
nlohmann::ordered_json describe(const std::filesystem::path& path);

struct FoundSample {
  std::filesystem::path shard;
  manifests::ShardSample sample;
};
// Returns the sample with this id, of a dataset or of a single shard. Throws std::runtime_error if the id
// does not exist or was not kept.
FoundSample find_sample(const std::filesystem::path& path, const std::string& id);

// Returns everything that is stored about one sample except its picture. Throws like find_sample.
nlohmann::ordered_json describe_sample(const std::filesystem::path& path, const std::string& id);

// These return the same for people, as a page of at most some sixty lines. They throw like the functions
// above.
std::string page(const std::filesystem::path& path);
std::string sample_page(const std::filesystem::path& path, const std::string& id);

// Returns `count` samples spread evenly over the dataset's rows, or all if there are fewer.
std::vector<manifests::ShardSample> spread_samples(const std::filesystem::path& path, int count);

}  // namespace q3d::pipeline::dataset
