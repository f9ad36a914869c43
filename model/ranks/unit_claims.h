// Decides which rank makes which unit of a run.
//
// A unit is given to the first rank that asks. Every rank keeps one word in the store: the units that it has
// open, and a number that grows as long as it lives. When all units are given away, a rank without work reads
// these words. It makes a unit of another rank once more when that rank has died, or has had the unit open
// for far longer than its own units took. Two ranks that make one unit write the same bytes, so neither
// disturbs the other, and a slow or dead rank delays nobody.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "model/ranks/shared_store.h"

namespace q3d::model::ranks {

using ClaimClock = std::chrono::steady_clock;
using ClaimSeconds = std::chrono::duration<double>;

struct ClaimRules {
  ClaimSeconds beat{1.0};        // between two signs of life; claim_rules() lengthens it for many ranks
  double lost_after_beats = 15;  // a rank without a sign of life for so long has died
  // A unit is slow that is open for so many times the longest of the idle rank's units, and at least for
  // least_slow.
  double slow_factor = 3.0;
  ClaimSeconds least_slow{10.0};
};

// Rules that keep the store's load bounded, whatever the number of ranks.
ClaimRules claim_rules(int ranks);

// A rank tells these numbers of each finished unit, such as its numbers of verdicts. They are added up.
using Tally = std::array<std::int64_t, 4>;

// Thread-safe. Functions that ask the store throw StoreLost.
class UnitClaims {
 public:
  using Now = std::function<ClaimClock::time_point()>;

  // `store` must outlive the claims. Nothing is told before the first beat.
  UnitClaims(SharedStore& store, int rank, int ranks, ClaimRules rules, Now now = &ClaimClock::now);

  const ClaimRules& rules() const { return rules_; }

  // Gives every rank an empty word. Rank 0 calls it before any other rank looks at the words.
  void prepare();
  // Tells the others that this rank lives, and what it has open.
  void beat();

  // A unit that no rank has had, from 0 to units - 1 in rising order; nothing when there is none. A rank with
  // open units gets no other when so few are left that each rank may get one.
  std::optional<std::int64_t> next(std::int64_t units);

  struct Remainder {
    std::optional<std::int64_t> unit;  // of another rank, for this one to make as well
    bool is_finished = false;          // no rank that lives has a unit open that no other has made
  };
  // Says what other ranks still do, when next() gives nothing and this rank has no unit open.
  Remainder remainder();

  // Call this when the unit's files and its journal lines are on disk.
  void finish(std::int64_t unit, const Tally& tally);

  // Says that this rank ends. The other ranks make the units that it has open.
  void leave();
  // Returns whether another rank has left or died.
  bool has_gone(int rank);
  // Returns whether each of the other ranks has joined and left.
  bool have_all_left();

  // Returns the sum of the numbers that the other ranks have told.
  Tally others();

 private:
  struct OpenUnit {
    std::int64_t unit = 0;
    int of = -1;  // the rank whose unit is made once more
    ClaimClock::time_point since;
  };
  struct Word;  // of one rank
  static Word read_word(const std::string& text);
  void watch(int rank, const Word& word);
  struct Sign {
    std::int64_t beats = -1;
    ClaimClock::time_point changed;
  };

  std::string own_word();
  std::vector<Word> read_words();
  bool is_lost(int rank, const Word& word) const;

  SharedStore& store_;
  int rank_;
  int ranks_;
  ClaimRules rules_;
  Now now_;
  std::vector<std::string> keys_;

  std::mutex mutex_;  // guards what follows
  std::int64_t beats_ = 0;
  std::vector<OpenUnit> open_;
  bool is_claiming_ = false;
  bool has_left_ = false;
  std::vector<std::int64_t> copied_;  // units of other ranks that this one has finished
  ClaimSeconds longest_{0.0};
  Tally tally_{};
  std::map<int, Sign> signs_;  // of the others
};

}  // namespace q3d::model::ranks
