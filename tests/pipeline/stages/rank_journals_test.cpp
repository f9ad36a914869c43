#include "pipeline/stages/rank_journals.h"

#include <gmock/gmock.h>

#include <string>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "pipeline/stages/stage_store.h"
#include "pipeline/stages/stages.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::stages {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

manifests::Table table_of(double value) {
  manifests::Table table;
  table.rows = 1;
  table.add<double>("error", {}, std::vector<double>{value});
  return table;
}

class RankJournals : public ::testing::Test {
 protected:
  StageStore open(int rank) {
    return {scratch_.path(), "predict", key_, &candidates::Unit::input_digest, {"run", rank, 3}};
  }
  fs::path folder() const { return stage_folder(scratch_.path(), "predict", key_); }
  static candidates::Unit unit(std::int64_t index, const std::string& digest = "input") {
    return {index, 0, 1, digest, digest};
  }
  std::vector<std::int64_t> journal_units() const {
    std::vector<std::int64_t> units;
    const manifests::Journal journal(folder() / "journal.jsonl");
    for (const auto& [index, entry] : journal.entries()) units.push_back(index);
    return units;
  }

  testing::ScratchDir scratch_;
  std::string key_ = std::string(64, 'b');
};

TEST_F(RankJournals, Rank0TakesOverWhatTheOthersMade) {
  StageStore first = open(0);
  StageStore second = open(1);
  StageStore third = open(2);
  third.save(unit(0), table_of(0));
  first.save(unit(1), table_of(1));
  second.save(unit(2), table_of(2));
  EXPECT_FALSE(first.load(unit(0)));
  first.take_over_ranks();
  for (std::int64_t i = 0; i < 3; ++i) {
    const auto table = first.load(unit(i));
    ASSERT_TRUE(table) << i;
    EXPECT_EQ(table->column<double>("error")[0], static_cast<double>(i));
  }
  EXPECT_THAT(find_rank_journals(folder()), IsEmpty());
  EXPECT_THAT(journal_units(), ElementsAre(0, 1, 2));
}

TEST_F(RankJournals, TheJournalEqualsThatOfOneProcess) {
  {
    StageStore first = open(0);
    StageStore second = open(1);
    second.save(unit(0), table_of(0));
    first.save(unit(1), table_of(1));
    first.take_over_ranks();
  }
  const std::string shared = manifests::read_file(folder() / "journal.jsonl");
  fs::remove_all(folder());
  {
    StageStore alone = open(0);
    alone.save(unit(0), table_of(0));
    alone.save(unit(1), table_of(1));
  }
  EXPECT_EQ(shared, manifests::read_file(folder() / "journal.jsonl"));
}

TEST_F(RankJournals, TheNextRunTakesOverWhatAKilledRunLeft) {
  {
    StageStore first = open(0);
    StageStore second = open(1);
    second.save(unit(4), table_of(4));
  }
  ASSERT_EQ(find_rank_journals(folder()).size(), 1U);
  StageStore next(scratch_.path(), "predict", key_);
  EXPECT_TRUE(next.has(unit(4)));
  EXPECT_THAT(find_rank_journals(folder()), IsEmpty());
}

TEST_F(RankJournals, OfTwoLinesForOneUnitThatOfTheFileCounts) {
  for (const int last : {1, 2}) {
    fs::remove_all(folder());
    StageStore first = open(0);
    StageStore second = open(1);
    StageStore third = open(2);
    const auto save = [&](int rank) { (rank == 1 ? second : third).save(unit(0), table_of(rank)); };
    save(3 - last);
    save(last);
    first.take_over_ranks();
    const auto table = first.load(unit(0));
    ASSERT_TRUE(table);
    EXPECT_EQ(table->column<double>("error")[0], last);
  }
}

TEST_F(RankJournals, ALineOfAnEarlierInputDoesNotHideTheNewOne) {
  {
    StageStore alone(scratch_.path(), "predict", key_);
    alone.save(unit(0, "old"), table_of(7));
  }
  StageStore first = open(0);
  StageStore second = open(1);
  second.save(unit(0, "new"), table_of(8));
  first.take_over_ranks();
  EXPECT_FALSE(first.has(unit(0, "old")));
  EXPECT_TRUE(first.has(unit(0, "new")));
}

}  // namespace
}  // namespace q3d::pipeline::stages
