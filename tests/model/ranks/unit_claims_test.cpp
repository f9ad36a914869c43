// Ranks as objects of one process, over a store in memory and a clock that the test turns.
#include "model/ranks/unit_claims.h"

#include <gtest/gtest.h>

#include <deque>
#include <map>
#include <set>

namespace q3d::model::ranks {
namespace {

using std::chrono::seconds;

class MemoryStore : public SharedStore {
 public:
  std::int64_t add(const std::string& key, std::int64_t value) override { return counters_[key] += value; }
  void set(const std::string& key, const std::string& value) override { texts_[key] = value; }
  std::optional<std::string> get(const std::string& key) override {
    const auto found = texts_.find(key);
    return found == texts_.end() ? std::nullopt : std::optional(found->second);
  }
  std::vector<std::string> get_all(const std::vector<std::string>& keys) override {
    std::vector<std::string> texts;
    for (const std::string& key : keys) texts.push_back(texts_.at(key));
    return texts;
  }

 private:
  std::map<std::string, std::int64_t> counters_;
  std::map<std::string, std::string> texts_;
};

class UnitClaimsTest : public ::testing::Test {
 protected:
  void start(int ranks) {
    for (int rank = 0; rank < ranks; ++rank) {
      claims_.emplace_back(store_, rank, ranks, rules_, [this] { return now_; });
    }
    claims_[0].prepare();
  }
  UnitClaims& rank(std::size_t number) { return claims_[number]; }
  // All ranks but those named give signs of life for so long.
  void pass(seconds time, const std::set<std::size_t>& silent = {}) {
    for (seconds passed{0}; passed < time; ++passed) {
      now_ += seconds(1);
      for (std::size_t i = 0; i < claims_.size(); ++i) {
        if (!silent.contains(i)) claims_[i].beat();
      }
      for (std::size_t i = 0; i < claims_.size(); ++i) {
        if (!silent.contains(i)) claims_[i].others();  // reads the words, as a process does at every beat
      }
    }
  }

  ClaimRules rules_;
  MemoryStore store_;
  ClaimClock::time_point now_{};
  std::deque<UnitClaims> claims_;
};

TEST_F(UnitClaimsTest, EveryUnitIsGivenOnce) {
  start(3);
  std::multiset<std::int64_t> given;
  for (int i = 0; i < 30; ++i) {
    const auto unit = rank(static_cast<std::size_t>(i * i) % 3).next(20);
    if (unit) {
      given.insert(*unit);
      rank(static_cast<std::size_t>(i * i) % 3).finish(*unit, {1, 0, 0, 2});
    }
  }
  std::multiset<std::int64_t> all;
  for (std::int64_t unit = 0; unit < 20; ++unit) all.insert(unit);
  EXPECT_EQ(given, all);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_TRUE(rank(i).remainder().is_finished);
  const Tally others = rank(2).others();  // rank 2 never asked: i * i is 0 or 1 modulo 3
  EXPECT_EQ(others, (Tally{20, 0, 0, 40}));
}

TEST_F(UnitClaimsTest, TheLastUnitsGoToRanksWithoutWork) {
  start(2);
  EXPECT_EQ(rank(0).next(4), 0);
  EXPECT_EQ(rank(0).next(4), 1);  // ahead of its work, as long as enough is left
  EXPECT_EQ(rank(0).next(4), std::nullopt);
  EXPECT_EQ(rank(1).next(4), 2);
  EXPECT_EQ(rank(1).next(4), std::nullopt);
  rank(1).finish(2, {});
  EXPECT_EQ(rank(1).next(4), 3);
}

TEST_F(UnitClaimsTest, AnOpenUnitOfALivingRankIsWaitedFor) {
  start(2);
  const auto unit = rank(1).next(1);
  ASSERT_TRUE(unit);
  pass(seconds(9));
  const auto rest = rank(0).remainder();
  EXPECT_FALSE(rest.unit);
  EXPECT_FALSE(rest.is_finished);
  rank(1).finish(*unit, {});
  EXPECT_TRUE(rank(0).remainder().is_finished);
}

TEST_F(UnitClaimsTest, TheUnitOfADeadRankIsMadeByOneOther) {
  rules_.least_slow = seconds(1000);
  start(4);
  ASSERT_EQ(rank(3).next(1), 0);
  pass(seconds(14), {3});
  EXPECT_FALSE(rank(0).remainder().unit);
  pass(seconds(3), {3});
  EXPECT_EQ(rank(1).remainder().unit, 0);
  const auto rest = rank(0).remainder();
  EXPECT_FALSE(rest.unit);
  EXPECT_FALSE(rest.is_finished);
  // The second rank dies over it too.
  pass(seconds(17), {1, 3});
  EXPECT_EQ(rank(2).remainder().unit, 0);
  rank(2).finish(0, {});
  EXPECT_TRUE(rank(0).remainder().is_finished);
}

TEST_F(UnitClaimsTest, ARankThatLeavesGivesItsUnitBackAtOnce) {
  start(2);
  ASSERT_EQ(rank(1).next(1), 0);
  rank(1).leave();
  EXPECT_EQ(rank(0).remainder().unit, 0);
  EXPECT_TRUE(rank(0).have_all_left());
  EXPECT_TRUE(rank(0).has_gone(1));
}

TEST_F(UnitClaimsTest, ASlowRankHoldsNobody) {
  start(3);
  ASSERT_EQ(rank(0).next(3), 0);
  ASSERT_EQ(rank(1).next(3), 1);
  ASSERT_EQ(rank(2).next(3), 2);
  pass(seconds(20));
  rank(0).finish(0, {});
  rank(1).finish(1, {});
  pass(seconds(39));  // three times the longest unit is 60 s
  EXPECT_FALSE(rank(0).remainder().unit);
  pass(seconds(2));
  EXPECT_EQ(rank(0).remainder().unit, 2);
  EXPECT_FALSE(rank(1).remainder().is_finished);
  rank(0).finish(2, {});
  EXPECT_TRUE(rank(1).remainder().is_finished);  // though rank 2 still has it open
}

TEST_F(UnitClaimsTest, ASlowRanksOwnTimesDoNotExcuseIt) {
  start(2);
  ASSERT_EQ(rank(0).next(3), 0);
  pass(seconds(4));
  rank(0).finish(0, {});
  ASSERT_EQ(rank(1).next(3), 1);
  pass(seconds(100));
  rank(1).finish(1, {});
  ASSERT_EQ(rank(1).next(3), 2);
  pass(seconds(13));  // three times the 4 s of rank 0
  EXPECT_EQ(rank(0).remainder().unit, 2);
}

TEST_F(UnitClaimsTest, ACopyWhoseFirstMakingEndedHoldsNobody) {
  start(3);
  ASSERT_EQ(rank(2).next(1), 0);
  pass(seconds(11));
  ASSERT_EQ(rank(0).remainder().unit, 0);
  rank(2).finish(0, {});
  EXPECT_TRUE(rank(1).remainder().is_finished);
}

TEST_F(UnitClaimsTest, ARankThatNeverCameHoldsNobody) {
  start(3);
  EXPECT_EQ(rank(0).next(1), 0);
  rank(0).finish(0, {});
  EXPECT_TRUE(rank(0).remainder().is_finished);
  EXPECT_FALSE(rank(0).have_all_left());
  EXPECT_FALSE(rank(0).has_gone(1));
}

}  // namespace
}  // namespace q3d::model::ranks
