#include "pipeline/stages/stage_store.h"

#include <gmock/gmock.h>

#include <atomic>
#include <cerrno>
#include <fstream>
#include <thread>
#include <vector>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/file_descriptor.h"
#include "tests/support/failing_io.h"
#include "tests/support/paths.h"
#include "tests/support/told.h"

namespace q3d::pipeline::stages {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

manifests::Table table_of(double value) {
  manifests::Table table;
  table.rows = 2;
  table.add<double>("error", {}, std::vector<double>{value, value + 1.0});
  return table;
}

class StageStoreTest : public ::testing::Test {
 protected:
  StageStoreTest() {
    StageStore first = store();
    for (const candidates::Unit& unit : units_) first.save(unit, table_of(static_cast<double>(unit.index)));
  }

  // The store as the next run opens it.
  StageStore store() { return {scratch_.path(), "predict", std::string(64, 'a')}; }
  fs::path file(std::size_t unit) { return store().file(units_[unit]); }
  void flip_bit(const fs::path& path, std::uintmax_t at) {
    std::string content = manifests::read_file(path);
    content.at(at) ^= 1;
    std::ofstream(path, std::ios::binary) << content;
  }
  double first_error(StageStore& opened, std::size_t unit) {
    const auto table = opened.load(units_[unit]);
    return table ? table->column<double>("error")[0] : -1.0;
  }

  testing::ScratchDir scratch_;
  std::vector<candidates::Unit> units_{{0, 0, 2, "a", "a"}, {1, 2, 2, "b", "b"}, {2, 4, 2, "c", "c"}};
  q3d::testing::Told told_log_;
  std::vector<std::string>& told_ = told_log_.warnings;
};

TEST_F(StageStoreTest, FindsWhatAnEarlierRunSaved) {
  StageStore opened = store();
  for (std::size_t unit = 0; unit < 3; ++unit) {
    EXPECT_TRUE(opened.has(units_[unit]));
    EXPECT_EQ(first_error(opened, unit), static_cast<double>(unit));
  }
  candidates::Unit changed = units_[0];
  changed.input_digest = "other";
  EXPECT_FALSE(opened.has(changed));
  EXPECT_FALSE(opened.load(changed));
  EXPECT_THAT(told_, IsEmpty()) << "a unit with other input is stale, not damaged";
}

TEST_F(StageStoreTest, EveryFlippedBitOfATableIsFoundToldAndMadeAnew) {
  const std::string sound = manifests::read_file(file(1));
  const std::string digest = manifests::sha256(sound);
  for (std::uintmax_t at = 0; at < sound.size(); at += 37) {
    told_.clear();
    flip_bit(file(1), at);
    const std::string got = manifests::sha256_file(file(1));
    StageStore opened = store();
    ASSERT_FALSE(opened.load(units_[1])) << at;
    ASSERT_FALSE(opened.has(units_[1])) << at;
    ASSERT_THAT(told_, ElementsAre(AllOf(HasSubstr(file(1).string()), HasSubstr("unit 1 "), HasSubstr(got),
                                         HasSubstr(digest))))
        << at;
    ASSERT_EQ(first_error(opened, 0), 0.0) << "other units are used";
    opened.save(units_[1], table_of(1.0));
    ASSERT_EQ(manifests::read_file(file(1)), sound) << at;
    ASSERT_EQ(first_error(opened, 1), 1.0) << at;
  }
}

TEST_F(StageStoreTest, HasReadsTheFileOnceARunAndNoticesDamage) {
  flip_bit(file(2), fs::file_size(file(2)) / 2);
  StageStore opened = store();
  EXPECT_FALSE(opened.has(units_[2]));
  EXPECT_EQ(told_.size(), 1U);
  EXPECT_FALSE(opened.has(units_[2]));
  EXPECT_EQ(told_.size(), 1U) << "told once";

  EXPECT_TRUE(opened.has(units_[0]));
  const testing::FailingIo io(testing::Call::read, "unit-000000.h5", EIO);
  EXPECT_TRUE(opened.has(units_[0])) << "compared before in this run";
  EXPECT_EQ(io.failures(), 0);
}

TEST_F(StageStoreTest, CutAndRemovedFilesAreToldAndMadeAnew) {
  fs::resize_file(file(0), 100);
  fs::remove(file(1));
  StageStore opened = store();
  EXPECT_FALSE(opened.load(units_[0]));
  EXPECT_FALSE(opened.has(units_[1]));
  EXPECT_TRUE(opened.has(units_[2]));
  EXPECT_THAT(told_, ElementsAre(AllOf(HasSubstr(file(0).string()), HasSubstr("100 bytes")),
                                 AllOf(HasSubstr(file(1).string()), HasSubstr("gone"))));
}

TEST_F(StageStoreTest, AFileThatCannotBeReadStopsTheRunAndStaysFinished) {
  {
    StageStore opened = store();
    const testing::FailingIo io(testing::Call::read, "unit-000001.h5", EIO);
    EXPECT_THROW(opened.load(units_[1]), manifests::IoError);
    EXPECT_THROW(opened.has(units_[1]), manifests::IoError);
  }
  EXPECT_THAT(told_, IsEmpty());
  StageStore opened = store();
  EXPECT_EQ(first_error(opened, 1), 1.0);
}

TEST_F(StageStoreTest, ADamagedJournalLineIsToldAndItsUnitMadeAnew) {
  const fs::path journal = file(0).parent_path() / "journal.jsonl";
  flip_bit(journal, 20);
  StageStore opened = store();
  EXPECT_THAT(told_, ElementsAre(HasSubstr(journal.string() + ", line 1")));
  EXPECT_FALSE(opened.has(units_[0]));
  EXPECT_TRUE(opened.has(units_[1]));
  opened.save(units_[0], table_of(0.0));
  told_.clear();
  StageStore again = store();
  EXPECT_THAT(told_, IsEmpty());
  for (const candidates::Unit& unit : units_) EXPECT_TRUE(again.has(unit));
}

// As in a build: the writer saves units in their order while the threads that decode ask which are there.
TEST_F(StageStoreTest, OneThreadSavesWhileOthersAsk) {
  StageStore opened(scratch_.path(), "refine", std::string(64, 'b'));
  std::vector<candidates::Unit> units;
  for (int i = 0; i < 30; ++i)
    units.push_back({i, static_cast<std::size_t>(2 * i), 2, "in" + std::to_string(i), "of"});
  std::atomic<std::size_t> saved = 0;
  std::atomic<int> asked = 0, right = 0;
  std::vector<std::thread> readers;
  for (int t = 0; t < 4; ++t) {
    readers.emplace_back([&] {
      while (saved < units.size()) {
        const std::size_t there = saved;
        for (std::size_t i = 0; i < there; ++i) {
          const auto table = opened.load(units[i]);
          right += table && table->column<double>("error")[0] == static_cast<double>(i);
          ++asked;
        }
        if (there < units.size()) opened.has(units[there]);  // this moment it may be there or not
      }
    });
  }
  for (const candidates::Unit& unit : units) {
    opened.save(unit, table_of(static_cast<double>(unit.index)));
    ++saved;
  }
  for (std::thread& reader : readers) reader.join();
  EXPECT_GT(asked, 0);
  EXPECT_EQ(right, asked);
  EXPECT_THAT(told_, IsEmpty());
}

}  // namespace
}  // namespace q3d::pipeline::stages
