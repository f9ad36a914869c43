#include "pipeline/training/training_pools.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "pipeline/feed/pool_check.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::training {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> paths(const settings::PoolConfig& pool) {
  return {pool.shards.begin(), pool.shards.end()};
}

// Says why a shard cannot be opened; empty if it can.
std::string problem_of(const fs::path& shard) {
  try {
    const manifests::ShardReader reader(shard);
    return {};
  } catch (const std::runtime_error& error) {
    return error.what();
  }
}

[[noreturn]] void refuse(const std::vector<std::string>& damage) {
  constexpr std::size_t kShown = 20;
  std::string text = fmt::format("{} of the pools' shards and samples are damaged:", damage.size());
  for (std::size_t i = 0; i < std::min(kShown, damage.size()); ++i) text += "\n  " + damage[i];
  if (damage.size() > kShown) text += fmt::format("\n  and {} more", damage.size() - kShown);
  throw std::runtime_error(
      text +
      "\nrun `verify` on their datasets and repair them, or give --skip-damaged to train "
      "without them");
}

}  // namespace

TrainingPools::TrainingPools(const std::vector<settings::PoolConfig>& pools, bool skip_damaged) {
  for (const settings::PoolConfig& pool : pools) {
    if (!pools_.contains(pool.name)) check(pool, skip_damaged);
  }
  if (!skip_damaged && !left_out_.empty()) refuse(left_out_);
}

void TrainingPools::check(const settings::PoolConfig& pool, bool skip_damaged) {
  Sound& sound = pools_[pool.name];
  nlohmann::json& digests = identity_[pool.name] = nlohmann::json::array();
  for (feed::CheckedShard& shard : feed::check_shards(paths(pool))) {
    if (shard.problem.empty() && skip_damaged) shard.problem = problem_of(shard.file);
    if (!shard.problem.empty()) {
      left_out_.push_back(fmt::format("pool {}: {}: {}", pool.name, shard.file.string(), shard.problem));
      continue;
    }
    sound.shards.push_back(shard.file);
    digests.push_back(shard.sha256);
  }
  if (sound.shards.empty()) {
    if (skip_damaged)
      throw run::ConfigError(fmt::format("pool {}: all of its shards are damaged", pool.name));
    return;
  }
  for (const feed::DamagedRecord& record :
       feed::find_damaged_records(feed::ShardPool(pool.name, sound.shards), skip_damaged)) {
    left_out_.push_back(fmt::format("pool {}: {}: {}", pool.name, record.id, record.problem));
    sound.left_out.push_back(record.position);
  }
  if (!sound.left_out.empty()) digests.push_back({{"left_out", sound.left_out}});
}

feed::ShardPool TrainingPools::open(const std::string& name) const {
  const Sound& sound = pools_.at(name);
  feed::ShardPool pool(name, sound.shards);
  pool.leave_out(sound.left_out);
  return pool;
}

}  // namespace q3d::pipeline::training
