// Simulates a run of many ranks: units take random times, some ranks are slow, and some die. The claims are
// the program's own; the store is in memory and time is simulated, so that a run of days takes minutes.
//
//   claims_simulation RANKS UNITS [MEAN_UNIT_SECONDS] [DEATHS] [SLOW_RANKS]
//
// Prints one line of JSON, and ends with 1 if a unit was not made, or if none of the living made the rest.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <deque>
#include <limits>
#include <nlohmann/json.hpp>
#include <queue>
#include <random>
#include <unordered_map>
#include <vector>

#include "model/ranks/unit_claims.h"

namespace {

using namespace q3d::model::ranks;

class CountingStore : public SharedStore {
 public:
  std::int64_t add(const std::string& key, std::int64_t value) override {
    ++exchanges;
    return counters_[key] += value;
  }
  void set(const std::string& key, const std::string& value) override {
    ++exchanges;
    texts_[key] = value;
  }
  std::optional<std::string> get(const std::string& key) override {
    ++exchanges;
    const auto found = texts_.find(key);
    return found == texts_.end() ? std::nullopt : std::optional(found->second);
  }
  std::vector<std::string> get_all(const std::vector<std::string>& keys) override {
    ++exchanges;
    std::vector<std::string> texts;
    for (const std::string& key : keys) texts.push_back(texts_.at(key));
    return texts;
  }
  std::int64_t exchanges = 0;

 private:
  std::unordered_map<std::string, std::int64_t> counters_;
  std::unordered_map<std::string, std::string> texts_;
};

struct Options {
  int ranks = 0;
  std::int64_t units = 0;
  double mean_s = 2.0;
  int deaths = 0;
  int slow = 0;
};

constexpr double kSlowness = 20.0;  // how many times longer a slow rank takes

class Simulation {
 public:
  explicit Simulation(const Options& options)
      : options_(options), made_(static_cast<std::size_t>(options.units)), random_(1) {
    const ClaimRules rules = claim_rules(options.ranks);
    beat_s_ = rules.beat.count();
    for (int rank = 0; rank < options.ranks; ++rank) {
      claims_.emplace_back(store_, rank, options.ranks, rules, [this] {
        return ClaimClock::time_point(std::chrono::duration_cast<ClaimClock::duration>(ClaimSeconds(now_s_)));
      });
    }
    claims_[0].prepare();
    const double expected_s = options.mean_s * static_cast<double>(options.units) / options.ranks;
    death_s_.assign(claims_.size(), std::numeric_limits<double>::infinity());
    std::uniform_real_distribution<double> when(0.0, expected_s);
    // Rank 0 leads and does not die here; that ends a run, and the next start goes on from the journals.
    for (int i = 1; i <= options.deaths; ++i) death_s_[static_cast<std::size_t>(i)] = when(random_);
    for (std::size_t rank = 0; rank < claims_.size(); ++rank) {
      at(0.0, rank, Event::work);
      at(beat_s_ * static_cast<double>(rank) / options.ranks, rank, Event::beat);
    }
  }

  void run() {
    while (!events_.empty() && !is_finished_) {
      const Entry entry = events_.top();
      events_.pop();
      now_s_ = entry.time_s;
      if (now_s_ >= death_s_[entry.rank]) continue;
      if (entry.event == Event::beat) {
        claims_[entry.rank].beat();
        at(now_s_ + beat_s_, entry.rank, Event::beat);
      } else {
        work(entry.rank, entry.unit);
      }
    }
  }

  nlohmann::ordered_json result() const {
    const auto missing = std::count(made_.begin(), made_.end(), 0);
    std::int64_t twice = 0;
    for (const auto times : made_) twice += times > 1 ? times - 1 : 0;
    const double alive = options_.ranks - options_.deaths;
    const double bound_s = options_.mean_s * static_cast<double>(options_.units) / alive;
    return {{"ranks", options_.ranks},
            {"units", options_.units},
            {"deaths", options_.deaths},
            {"slow_ranks", options_.slow},
            {"units_not_made", missing},
            {"units_made_twice", twice},
            {"simulated_s", now_s_},
            {"without_loss_s", bound_s},
            {"store_exchanges_per_s", static_cast<double>(store_.exchanges) / now_s_},
            {"finished", is_finished_}};
  }

 private:
  enum class Event { beat, work };
  struct Entry {
    double time_s;
    std::size_t rank;
    Event event;
    std::int64_t unit;  // that ends now; -1 if there is none
    bool operator<(const Entry& other) const { return time_s > other.time_s; }
  };

  void at(double time_s, std::size_t rank, Event event, std::int64_t unit = -1) {
    events_.push({time_s, rank, event, unit});
  }

  double duration(std::size_t rank) {
    std::lognormal_distribution<double> factor(-0.125, 0.5);  // of mean 1
    const bool is_slow =
        static_cast<int>(rank) > options_.deaths && static_cast<int>(rank) <= options_.deaths + options_.slow;
    return options_.mean_s * factor(random_) * (is_slow ? kSlowness : 1.0);
  }

  void work(std::size_t rank, std::int64_t ended) {
    if (ended >= 0) {
      ++made_[static_cast<std::size_t>(ended)];
      claims_[rank].finish(ended, {1, 0, 0, 0});
    }
    auto unit = claims_[rank].next(options_.units);
    if (!unit) {
      const auto rest = claims_[rank].remainder();
      if (rest.is_finished) is_finished_ = is_finished_ || rank == 0;  // rank 0 publishes then
      if (rest.is_finished) return;
      unit = rest.unit;
    }
    if (unit) {
      at(now_s_ + duration(rank), rank, Event::work, *unit);
    } else {
      at(now_s_ + beat_s_, rank, Event::work);
    }
  }

  Options options_;
  CountingStore store_;
  std::deque<UnitClaims> claims_;
  std::vector<std::uint8_t> made_;  // how often each unit was
  std::vector<double> death_s_;
  std::mt19937_64 random_;
  std::priority_queue<Entry> events_;
  double beat_s_ = 1.0;
  double now_s_ = 0.0;
  bool is_finished_ = false;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    fmt::print(stderr, "usage: claims_simulation RANKS UNITS [MEAN_UNIT_SECONDS] [DEATHS] [SLOW_RANKS]\n");
    return 2;
  }
  Options options{std::atoi(argv[1]), std::atoll(argv[2])};
  if (argc > 3) options.mean_s = std::atof(argv[3]);
  if (argc > 4) options.deaths = std::atoi(argv[4]);
  if (argc > 5) options.slow = std::atoi(argv[5]);
  Simulation simulation(options);
  simulation.run();
  const nlohmann::ordered_json result = simulation.result();
  fmt::print("{}\n", result.dump());
  return result["units_not_made"] == 0 && result["finished"] ? 0 : 1;
}
