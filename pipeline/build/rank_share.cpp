#include "pipeline/build/rank_share.h"

#include <fmt/format.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <random>
#include <utility>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "pipeline/config/device_names.h"
#include "pipeline/network/torch_network.h"
#include "pipeline/run/errors.h"
#include "pipeline/run/interrupt.h"

namespace q3d::pipeline::build {
namespace {

using model::ranks::RankPlace;
using model::ranks::StoreLost;

constexpr const char* kDigests = "phase/digests";
constexpr const char* kStart = "phase/start";
constexpr const char* kEnd = "phase/end";
constexpr int kUnitsInFlight = 2;  // more would take units that another rank could make
constexpr std::chrono::milliseconds kPause{200};
constexpr std::chrono::seconds kFarewell{5};  // rank 0 keeps the store open so long for last messages

RankPlace find_place(bool shares_units) {
  if (!shares_units) return {};
  try {
    return model::ranks::rank_place_from_environment();
  } catch (const std::invalid_argument& error) {
    throw run::ConfigError(error.what());
  }
}

void require_stated_threads(const config::NetworkConfig& network) {
  if (network.compute_threads > 0 || !network::device_key(network).starts_with("cpu")) return;
  throw run::ConfigError(
      "network.compute_threads is 0, which may mean all cores of a machine, and its number decides the last "
      "bits of a "
      "result; ranks that share the work on CPUs need the same number on every machine, such as --set "
      "network.compute_threads=4");
}

// Removes the temporary files that killed ranks have left in the stages' folders. If a slow rank is still
// writing one, another rank makes its unit.
void remove_leftovers(const std::filesystem::path& out) {
  for (const auto& entry : std::filesystem::directory_iterator(out / "stages")) {
    if (entry.is_directory()) manifests::remove_temporaries(entry.path());
  }
}

// Calls a function at the end of a block, however it ends.
class AtEnd {
 public:
  explicit AtEnd(std::function<void()> call) : call_(std::move(call)) {}
  ~AtEnd() { call_(); }
  AtEnd(const AtEnd&) = delete;
  AtEnd& operator=(const AtEnd&) = delete;

 private:
  std::function<void()> call_;
};

// Returns a word that no other run has.
std::string new_run() {
  std::random_device random;
  return fmt::format("{:08x}{:08x}", random(), random());
}

}  // namespace

RankShare::RankShare(const config::NetworkConfig* network, const run::RunOptions& options,
                     const std::string& purpose)
    : place_(find_place(options.shares_units)), options_(options) {
  if (network != nullptr) config::require_device_for_each_rank(network->device, place_.local_size);
  if (!is_shared()) return;
  if (network != nullptr) require_stated_threads(*network);
  model::ranks::tell_launcher(place_);
  if (options_.threads == 0) options_.threads = model::ranks::own_cores(place_);
  if (!leads()) options_.quiet = true;
  if (leads()) run_ = new_run();
  store_ = model::ranks::open_shared_store(place_, purpose);
  claims_ = std::make_unique<model::ranks::UnitClaims>(*store_, place_.rank, place_.size,
                                                       model::ranks::claim_rules(place_.size));
  if (leads()) claims_->prepare();
  life_ = std::jthread([this](const std::stop_token& stop) { keep_alive(stop); });
}

RankShare::~RankShare() {
  if (!is_shared()) return;
  life_.request_stop();
  life_.join();
  try {
    claims_->leave();
    // Rank 0 failed and holds the store, so it tells the others, including those that are about to join.
    if (leads() && !is_over_ && !place_.launcher_has_store) say_farewell();
  } catch (const std::exception&) {
    // The other ranks notice that this rank no longer gives signs of life.
  }
}

config::NetworkConfig RankShare::own(config::NetworkConfig network) const {
  if (is_shared()) network.local_rank = place_.local_rank;
  return network;
}

void RankShare::keep_alive(const std::stop_token& stop) {
  const auto beat = std::chrono::duration_cast<std::chrono::milliseconds>(claims_->rules().beat);
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    lock.unlock();
    try {
      claims_->beat();
      const auto sum = leads() ? claims_->others() : model::ranks::Tally{};
      if (!leads() && store_->get(kEnd)) is_over_ = true;
      lock.lock();
      if (leads() && tell_others_) tell_others_(sum);
    } catch (const StoreLost&) {
      is_store_lost_ = true;
      return;
    }
    woken_.wait_for(lock, stop, beat, [] { return false; });
  }
}

// Asks rank 0 now, because the last answer may be older than a pause of this process.
void RankShare::hear_leader() {
  if (leads()) return;
  try {
    if (store_->get(kEnd)) is_over_ = true;
  } catch (const StoreLost&) {
    is_store_lost_ = true;
  }
}

void RankShare::pause() const {
  run::throw_if_interrupted();
  std::this_thread::sleep_for(std::max(kPause, std::chrono::milliseconds(2 * place_.size)));
}

// Waits for a key in the store. Returns nothing if rank 0 ends the work before.
std::optional<std::string> RankShare::await_word(const std::string& key) {
  try {
    for (;;) {
      if (auto word = store_->get(key)) return word;
      if (store_->get(kEnd)) return std::nullopt;
      if (claims_->has_gone(0)) break;
      pause();
    }
  } catch (const StoreLost&) {
    // The store is gone because rank 0, which holds it, has ended.
  }
  throw LeaderLost(fmt::format("rank {} of {}: rank 0 ended before the work began; its own message says why",
                               place_.rank, place_.size));
}

bool RankShare::await_digests() {
  return leads() || await_word(kDigests).has_value();
}

void RankShare::tell_digests() {
  if (is_shared() && leads()) store_->set(kDigests, "1");
}

bool RankShare::agree(const std::string& key, bool is_done) {
  if (!is_shared()) return is_done;
  if (leads()) {
    store_->set(kStart, nlohmann::json{{"key", key}, {"done", is_done}, {"run", run_}}.dump());
    return is_done;
  }
  const std::optional<std::string> word = await_word(kStart);
  if (!word) return true;
  const nlohmann::json start = nlohmann::json::parse(*word);
  if (start.at("key").get<std::string>() != key) {
    throw run::ConfigError(
        fmt::format("rank {} of {}: it was started with another configuration than rank 0, sees other files, "
                    "or computes on another "
                    "kind of device, so that its work would be another (got key {}, expected {})",
                    place_.rank, place_.size, key, start.at("key").get<std::string>()));
  }
  run_ = start.at("run").get<std::string>();
  return start.at("done").get<bool>();
}

stages::RankOfStore RankShare::of_store() const {
  return {run_, place_.rank, place_.size};
}

std::optional<std::int64_t> RankShare::claim(std::int64_t units) {
  if (is_over_ || is_store_lost_) return std::nullopt;
  try {
    return claims_->next(units);
  } catch (const StoreLost&) {
    is_store_lost_ = true;  // open units are finished first
    return std::nullopt;
  }
}

void RankShare::make(unit::UnitFlow flow, device::DeviceWorker& device, const Count& count,
                     TellOthers tell_others) {
  {
    const std::lock_guard lock(mutex_);
    tell_others_ = std::move(tell_others);
  }
  // The caller's counters may be gone after this function, also when it ends by an exception.
  const AtEnd stop_telling([this] {
    const std::lock_guard lock(mutex_);
    tell_others_ = nullptr;
  });
  has_shared_units_ = true;
  flow.units_in_flight = kUnitsInFlight;
  flow.write = [this, &count, write = std::move(flow.write)](unit::UnitWork& work) {
    hear_leader();
    if (is_over_) return;  // another rank has made the unit, and the dataset is published
    try {
      write(work);
    } catch (const std::exception&) {
      // Rank 0 may have taken this rank for dead, perhaps because it was paused, and removed its files.
      hear_leader();
      if (!is_over_ && !is_store_lost_) throw;
      return;
    }
    try {
      claims_->finish(work.unit->index, count(work));
    } catch (const StoreLost&) {
      is_store_lost_ = true;
    }
  };
  std::optional<std::int64_t> copy;
  bool has_worked = false;
  bool copies = false;
  flow.claim = [&, units = flow.units]() -> std::optional<std::int64_t> {
    const std::optional<std::int64_t> unit = copies ? std::exchange(copy, std::nullopt) : claim(units);
    has_worked |= unit.has_value();
    return unit;
  };
  while (!is_over_ && !is_store_lost_) {
    has_worked = false;
    unit::run_units(flow, device);
    copies = false;
    if (has_worked || is_store_lost_) continue;
    try {
      const auto rest = claims_->remainder();
      if (rest.is_finished) break;
      copy = rest.unit;
      copies = rest.unit.has_value();
      if (!copies) pause();
    } catch (const StoreLost&) {
      is_store_lost_ = true;
    }
  }
  if (is_store_lost_ && !leads()) {
    throw LeaderLost(fmt::format(
        "rank {} of {}: rank 0 has ended or cannot be reached. What this rank has finished stays; run the "
        "same command again to go on",
        place_.rank, place_.size));
  }
}

void RankShare::make(unit::UnitFlow flow, device::DeviceWorker& device, run::Progress& progress) {
  const auto count = [](const unit::UnitWork& work) {
    return model::ranks::Tally{static_cast<std::int64_t>(work.unit->count)};
  };
  make(std::move(flow), device, count,
       [&progress, told = std::int64_t{0}](const model::ranks::Tally& others) mutable {
         progress.advance(others[0] - std::exchange(told, others[0]));
       });
}

// Keeps the store open for ranks that are about to join or to leave.
void RankShare::say_farewell() {
  const auto deadline = std::chrono::steady_clock::now() + kFarewell;
  while (!claims_->have_all_left() && std::chrono::steady_clock::now() < deadline && !run::interrupted()) {
    std::this_thread::sleep_for(kPause);
  }
}

void RankShare::end() {
  if (!is_shared() || !leads()) return;
  try {
    is_over_ = true;
    store_->set(kEnd, "1");
    if (!place_.launcher_has_store) say_farewell();
  } catch (const StoreLost&) {
    is_store_lost_ = true;
  }
  if (has_shared_units_) remove_leftovers(options_.out);
}

std::string key_of_work(const std::string& stage_key, const std::vector<candidates::Unit>& units) {
  std::string text = stage_key;
  for (const candidates::Unit& unit : units) text += '\n' + unit.input_digest;
  return manifests::sha256(text);
}

}  // namespace q3d::pipeline::build
