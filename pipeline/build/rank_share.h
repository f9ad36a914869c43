// One process's part in a run that several ranks share: torchrun or srun starts the same command several
// times, the ranks meet in a store, and each takes units until none is left. Rank 0 leads: it holds the
// output folder's lock, reads the candidates first, takes over the lines of all journals, publishes, and
// reports for all.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "model/ranks/rank_place.h"
#include "model/ranks/shared_store.h"
#include "model/ranks/unit_claims.h"
#include "pipeline/config/build_config.h"
#include "pipeline/device/device_worker.h"
#include "pipeline/run/progress.h"
#include "pipeline/run/run_options.h"
#include "pipeline/stages/stage_store.h"
#include "pipeline/unit/unit_flow.h"

namespace q3d::pipeline::build {

// Says that rank 0 cannot be reached any more. The units that this rank has finished remain.
class LeaderLost : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class RankShare {
 public:
  // The ranks are those of the environment if options.shares_units is set, else this process is alone. Rank 0
  // waits for nobody. `network` is null if the work needs none. Throws ConfigError, also for a network on the
  // CPU without a number of compute_threads, and std::runtime_error if rank 0 is not reached in time.
  RankShare(const config::NetworkConfig* network, const run::RunOptions& options, const std::string& purpose);
  ~RankShare();
  RankShare(const RankShare&) = delete;
  RankShare& operator=(const RankShare&) = delete;

  bool is_shared() const { return place_.size > 1; }
  bool leads() const { return place_.rank == 0; }
  int rank() const { return place_.rank; }

  // Returns the settings of the network with this rank's GPU.
  config::NetworkConfig own(config::NetworkConfig network) const;
  // Returns the options with this rank's part of the machine's cores. All ranks but rank 0 are quiet.
  const run::RunOptions& options() const { return options_; }

  // Rank 0 digests the pictures; the others read the candidates when its digests are there. The others wait
  // in the first function until rank 0 calls the second. Returns false if rank 0 has called end() instead, so
  // that there is nothing to do. Throws LeaderLost and Interrupted.
  bool await_digests();
  void tell_digests();

  // All ranks call it before the first unit, rank 0 after it has opened the stages' folders; returns rank 0's
  // `is_done`. `key` names the work. Throws ConfigError if rank 0 has another, LeaderLost and Interrupted.
  bool agree(const std::string& key, bool is_done);

  // Says in which journals this rank keeps its lines. For ranks other than 0 it is complete after agree().
  stages::RankOfStore of_store() const;

  using Count = std::function<model::ranks::Tally(const unit::UnitWork&)>;
  using TellOthers = std::function<void(const model::ranks::Tally&)>;
  // Makes units until no living rank has an open one. `count` returns the numbers of a finished unit. In rank
  // 0, `tell_others` is called now and then, on a separate thread, with their sum over the other ranks.
  // Throws LeaderLost, Interrupted, and what the flow throws.
  void make(unit::UnitFlow flow, device::DeviceWorker& device, const Count& count, TellOthers tell_others);

  // The same for a flow whose `write` advances `progress` by the candidates of its own units; those of the
  // other ranks are added.
  void make(unit::UnitFlow flow, device::DeviceWorker& device, run::Progress& progress);

  // Tells the other ranks that no work is left, and removes the temporary files of killed ranks. Called by
  // rank 0.
  void end();

 private:
  void keep_alive(const std::stop_token& stop);
  std::optional<std::string> await_word(const std::string& key);
  std::optional<std::int64_t> claim(std::int64_t units);
  void hear_leader();
  void pause() const;
  void say_farewell();

  model::ranks::RankPlace place_;
  run::RunOptions options_;
  std::string run_;
  std::unique_ptr<model::ranks::SharedStore> store_;  // null if this process is alone
  std::unique_ptr<model::ranks::UnitClaims> claims_;
  std::atomic<bool> is_store_lost_ = false;
  std::atomic<bool> is_over_ = false;  // rank 0 needs no more units
  bool has_shared_units_ = false;
  std::mutex mutex_;
  std::condition_variable_any woken_;
  TellOthers tell_others_;  // guarded by mutex_
  std::jthread life_;       // the last member: it uses the others
};

// Returns a digest of the key of a stage and its units' inputs, for RankShare::agree().
std::string key_of_work(const std::string& stage_key, const std::vector<candidates::Unit>& units);

}  // namespace q3d::pipeline::build
