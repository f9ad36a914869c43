// Damage in the shards of a training pool: it must not become other weights without a word.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/feed/shard_pool.h"

namespace q3d::pipeline::feed {

struct CheckedShard {
  std::filesystem::path file;
  std::string sha256;   // of its bytes; empty if it is gone
  std::string problem;  // why it cannot be trusted, in words; empty if it can
};

// Reads every shard of the sources whole and compares it with the dataset.json of the dataset to which it
// belongs, where there is one: a shard lies in <dataset>/shards. Of a source that is a folder, the shards
// that dataset.json lists must all be there. Throws std::runtime_error that names the file if a dataset.json
// is damaged, manifests::IoError, Interrupted, and like shard_files.
std::vector<CheckedShard> check_shards(const std::vector<std::filesystem::path>& sources);

struct DamagedRecord {
  std::int64_t position = 0;  // in the pool
  std::string id;
  std::string problem;
};

// The samples of which training can make nothing: boxes without a size or of an absurd one, and numbers of a
// label that are not finite. `decode`: also those whose stored crop cannot be decoded, which takes about as
// long as an epoch's reading. In the order of the pool. Throws Interrupted.
std::vector<DamagedRecord> find_damaged_records(const ShardPool& pool, bool decode);

}  // namespace q3d::pipeline::feed
