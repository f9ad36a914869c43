#include "manifests/journal.h"

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "manifests/atomic_file.h"
#include "tests/manifests/full_disk.h"
#include "tests/support/paths.h"

namespace q3d::manifests {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class JournalTest : public ::testing::Test {
 protected:
  JournalEntry make_unit(std::int64_t unit) {
    const std::string name = "unit" + std::to_string(unit) + ".h5";
    std::ofstream(scratch_.path() / name) << "12345";
    return {unit, "input" + std::to_string(unit), name, "digest \"quoted\"\n", 5, 3};
  }
  void append_units(int count) {
    Journal journal(path_);
    for (int unit = 0; unit < count; ++unit) journal.append(make_unit(unit));
  }
  testing::ScratchDir scratch_;
  fs::path path_ = scratch_.path() / "journal";
};

TEST_F(JournalTest, FindsWhatWasAppendedAfterReloading) {
  append_units(3);
  const Journal journal(path_);
  EXPECT_EQ(journal.entries().size(), 3U);
  EXPECT_FALSE(journal.dropped_torn_line());
  const auto entry = journal.find(1, "input1");
  ASSERT_TRUE(entry);
  EXPECT_EQ(entry->file, "unit1.h5");
  EXPECT_EQ(entry->sha256, "digest \"quoted\"\n");
  EXPECT_EQ(entry->bytes, 5);
  EXPECT_EQ(entry->rows, 3);
}

TEST_F(JournalTest, DoesNotFindStaleAbsentOrForgottenUnits) {
  append_units(3);
  const std::string whole = read_file(path_);
  Journal journal(path_);
  EXPECT_FALSE(journal.find(3, "input3"));
  EXPECT_FALSE(journal.find(0, "another input"));
  journal.forget(1);
  EXPECT_FALSE(journal.find(1, "input1"));
  EXPECT_TRUE(journal.find(0, "input0"));
  EXPECT_EQ(read_file(path_), whole) << "forgetting changes nothing on disk";
  journal.append(make_unit(1));
  EXPECT_TRUE(journal.find(1, "input1"));
}

TEST_F(JournalTest, TheLatestEntryOfAUnitCounts) {
  append_units(1);
  auto entry = make_unit(0);
  entry.input_digest = "changed";
  Journal(path_).append(entry);
  const Journal journal(path_);
  EXPECT_FALSE(journal.find(0, "input0"));
  EXPECT_TRUE(journal.find(0, "changed"));
}

TEST_F(JournalTest, AUnitWithoutAFileIsFound) {
  Journal(path_).append({7, "input", "", "", 0, 0});
  EXPECT_TRUE(Journal(path_).find(7, "input"));
}

// Every length at which a kill can leave the last line.
TEST_F(JournalTest, DropsATornLastLineOfAnyLengthAndAppendsAfterIt) {
  append_units(2);
  const std::string whole = read_file(path_);
  const std::size_t second_line = whole.find('\n') + 1;
  for (std::size_t length = second_line + 1; length < whole.size(); ++length) {
    std::ofstream(path_) << whole.substr(0, length);
    Journal journal(path_);
    ASSERT_EQ(journal.entries().size(), 1U) << length;
    ASSERT_TRUE(journal.dropped_torn_line()) << length;
    journal.append(make_unit(1));
    ASSERT_EQ(read_file(path_), whole) << length;
  }
}

TEST_F(JournalTest, DropsALineWithAnyFlippedByteAndWritesTheFileWithoutIt) {
  append_units(3);
  const std::string whole = read_file(path_);
  const std::size_t first_line = whole.find('\n');
  const std::string rest = whole.substr(first_line + 1);
  for (std::size_t at = 0; at < first_line; ++at) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 1);
    std::ofstream(path_) << damaged;
    Journal journal(path_);
    ASSERT_EQ(journal.damaged_lines().size(), damaged[at] == '\n' ? 2U : 1U) << at;
    ASSERT_EQ(journal.damaged_lines()[0], 1) << at;
    ASSERT_FALSE(journal.dropped_torn_line()) << at;
    ASSERT_FALSE(journal.find(0, "input0")) << at;
    ASSERT_TRUE(journal.find(1, "input1") && journal.find(2, "input2")) << at;
    ASSERT_EQ(read_file(path_), damaged) << at << ": loading changes nothing on disk";
    journal.append(make_unit(0));
    ASSERT_EQ(read_file(path_), rest + whole.substr(0, first_line + 1)) << at;
    journal.append(make_unit(3));
    ASSERT_EQ(Journal(path_).entries().size(), 4U) << at;
    ASSERT_TRUE(Journal(path_).damaged_lines().empty()) << at;
  }
}

// The line feed between two lines is damaged: both are lost, and a torn last line beside them is cut off too.
TEST_F(JournalTest, DropsTwoLinesThatRanTogetherAndATornOne) {
  append_units(4);
  std::string damaged = read_file(path_);
  damaged[damaged.find('\n')] = 'x';
  damaged.resize(damaged.size() - 5);
  std::ofstream(path_) << damaged;
  Journal journal(path_);
  EXPECT_EQ(journal.damaged_lines(), std::vector<std::int64_t>{1});
  EXPECT_TRUE(journal.dropped_torn_line());
  EXPECT_EQ(journal.entries().size(), 1U);
  EXPECT_TRUE(journal.find(2, "input2"));
  for (const int unit : {0, 1, 3}) journal.append(make_unit(unit));
  const Journal again(path_);
  EXPECT_EQ(again.entries().size(), 4U);
  EXPECT_TRUE(again.damaged_lines().empty());
  EXPECT_FALSE(again.dropped_torn_line());
}

TEST_F(JournalTest, FullDiskLeavesADamagedJournalAsItWas) {
  append_units(3);
  std::string damaged = read_file(path_);
  damaged[3] ^= 1;
  std::ofstream(path_) << damaged;
  Journal journal(path_);
  {
    const testing::FullDisk full(damaged.size() / 2);
    EXPECT_THROW(journal.append(make_unit(0)), std::runtime_error);
  }
  EXPECT_EQ(read_file(path_), damaged);
  journal.append(make_unit(0));
  EXPECT_EQ(Journal(path_).entries().size(), 3U);
  EXPECT_TRUE(Journal(path_).damaged_lines().empty());
}

TEST_F(JournalTest, FullDiskLeavesTheJournalAsItWas) {
  append_units(2);
  const std::string before = read_file(path_);
  Journal journal(path_);
  {
    const testing::FullDisk full(before.size() + 10);
    EXPECT_THAT([&] { journal.append(make_unit(2)); },
                ThrowsMessage<std::runtime_error>(HasSubstr(path_.string())));
  }
  EXPECT_EQ(read_file(path_), before);
  EXPECT_EQ(journal.entries().size(), 2U);
  journal.append(make_unit(2));
  EXPECT_EQ(Journal(path_).entries().size(), 3U);
}

TEST_F(JournalTest, RefusesToAppendBehindAnotherWriter) {
  append_units(1);
  Journal journal(path_);
  Journal(path_).append(make_unit(1));
  EXPECT_THAT([&] { journal.append(make_unit(2)); },
              ThrowsMessage<std::runtime_error>(HasSubstr("Another build")));
  EXPECT_EQ(Journal(path_).entries().size(), 2U);
}

TEST_F(JournalTest, RefusesFilesOutsideItsFolder) {
  Journal journal(path_);
  EXPECT_THROW(journal.append({0, "input", "../escape", "", 0, 0}), std::invalid_argument);
  EXPECT_THROW(journal.append({0, "input", "/etc/passwd", "", 0, 0}), std::invalid_argument);
}

TEST_F(JournalTest, KeepsEveryAppendThatReturnedBeforeAKill) {
  int channel[2];
  ASSERT_EQ(::pipe(channel), 0);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    Journal journal(path_);
    for (std::int64_t unit = 0;; ++unit) {
      journal.append({unit, "input", "", "", 0, 0});
      if (::write(channel[1], "x", 1) != 1) ::_exit(1);
    }
  }
  char done = 0;
  int returned = 0;
  for (; returned < 20 && ::read(channel[0], &done, 1) == 1; ++returned) {
  }
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  ::close(channel[0]);
  ::close(channel[1]);
  const Journal journal(path_);
  for (std::int64_t unit = 0; unit < returned; ++unit) EXPECT_TRUE(journal.find(unit, "input")) << unit;
  EXPECT_EQ(returned, 20);
}

}  // namespace
}  // namespace q3d::manifests
