// Finds damage in the shards of a training pool. Damage must not change the trained weights silently.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/feed/shard_pool.h"

namespace q3d::pipeline::feed {

struct CheckedShard {
  std::filesystem::path file;
  std::string sha256;   // SHA-256 of its bytes; empty if it is gone
  std::string problem;  // why it cannot be trusted, in words; empty if it can
};

// Reads every shard of the sources completely and compares it with the dataset.json of its dataset, if there
// is one; a shard lies in <dataset>/shards. If a source is a folder, all shards that dataset.json lists must
// exist. Throws std::runtime_error that names the file if a dataset.json is damaged, manifests::IoError,
// Interrupted, and like shard_files.
std::vector<CheckedShard> check_shards(const std::vector<std::filesystem::path>& sources);

struct DamagedRecord {
  std::int64_t position = 0;  // in the pool
  std::string id;
  std::string problem;
};

// Returns the samples that training cannot use, in the order of the pool: those whose box has no size or an
// absurd one, and those with label numbers that are not finite. With `decode`, also those whose stored crop
// cannot be decoded; this takes about as long as reading an epoch. Throws Interrupted.
std::vector<DamagedRecord> find_damaged_records(const ShardPool& pool, bool decode);

}  // namespace q3d::pipeline::feed
