// `verify`: reads a finished dataset whole and checks everything that can be checked.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace q3d::pipeline::dataset {

struct VerifySummary {
  std::filesystem::path folder;
  std::int64_t shards = 0;
  std::int64_t samples = 0;
  std::int64_t pictures = 0;          // stored crops that were decoded
  std::vector<std::string> problems;  // empty when the dataset is sound
};

// Recomputes every digest from the bytes (no cache), reads every shard through its schema, decodes every
// stored crop, and checks that dataset.json, verdicts.csv and the shards agree with each other: counts, ids,
// verdicts, labels and projections. Problems are listed, not thrown; throws std::runtime_error when `given`
// holds no readable dataset.json at all, and Interrupted.
VerifySummary verify(const std::filesystem::path& given, bool quiet);

}  // namespace q3d::pipeline::dataset
