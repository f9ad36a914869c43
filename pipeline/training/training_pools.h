// The samples of a training run, which are checked before any of them is used.
#pragma once

#include <nlohmann/json.hpp>

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "pipeline/feed/shard_pool.h"
#include "pipeline/training/settings/training_config.h"

namespace q3d::pipeline::training {

class TrainingPools {
 public:
  // Reads all shards of the pools whole (feed::check_shards) and looks at every record
  // (feed::find_damaged_records). Damage throws std::runtime_error that counts and names it. With
  // `skip_damaged`, it is left out instead: damaged records, and damaged shards with all their records,
  // because nothing says which of these are correct. In this case every stored crop is decoded too. Throws
  // ConfigError if a pool has no sample left, Interrupted, and like check_shards.
  TrainingPools(const std::vector<settings::PoolConfig>& pools, bool skip_damaged);

  // Opens one of the pools, without the samples that are left out.
  feed::ShardPool open(const std::string& name) const;
  // Returns everything that decides which samples are used: the shards' digests by pool, and the samples that
  // are left out.
  const nlohmann::json& identity() const { return identity_; }
  const std::vector<std::string>& left_out() const { return left_out_; }  // each with its reason

 private:
  struct Sound {
    std::vector<std::filesystem::path> shards;
    std::vector<std::int64_t> left_out;  // positions
  };
  void check(const settings::PoolConfig& pool, bool skip_damaged);

  std::map<std::string, Sound> pools_;  // by name
  nlohmann::json identity_ = nlohmann::json::object();
  std::vector<std::string> left_out_;
};

}  // namespace q3d::pipeline::training
