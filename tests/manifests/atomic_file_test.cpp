#include "manifests/atomic_file.h"

#include <gmock/gmock.h>

#include <fstream>

#include "manifests/digest.h"
#include "tests/manifests/full_disk.h"
#include "tests/support/paths.h"

namespace q3d::manifests {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::size_t count_files(const fs::path& folder) {
  return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(AtomicFile, WritesAndReplacesWholeFiles) {
  const testing::ScratchDir scratch;
  const fs::path path = scratch.path() / "a.json";
  write_file_atomically(path, "first");
  EXPECT_EQ(read_file(path), "first");
  write_file_atomically(path, "");
  EXPECT_EQ(read_file(path), "");
  EXPECT_EQ(count_files(scratch.path()), 1U);
}

TEST(AtomicFile, FullDiskKeepsTheOldFileAndLeavesNoTemporary) {
  const testing::ScratchDir scratch;
  const fs::path path = scratch.path() / "a.bin";
  write_file_atomically(path, "old");
  {
    const testing::FullDisk full(4096);
    EXPECT_THAT(
        [&] { write_file_atomically(path, std::string(10'000, 'x')); },
        ThrowsMessage<std::runtime_error>(AllOf(HasSubstr(path.string()), HasSubstr("File too large"))));
  }
  EXPECT_EQ(read_file(path), "old");
  EXPECT_EQ(count_files(scratch.path()), 1U);
}

TEST(AtomicFile, NamesThePathThatCannotBeWrittenOrRead) {
  const testing::ScratchDir scratch;
  const fs::path path = scratch.path() / "absent" / "a.json";
  const auto names_it = AllOf(HasSubstr(path.string()), HasSubstr("No such file or directory"));
  EXPECT_THAT([&] { write_file_atomically(path, "x"); }, ThrowsMessage<std::runtime_error>(names_it));
  EXPECT_THAT([&] { read_file(path); }, ThrowsMessage<std::runtime_error>(names_it));
}

TEST(AtomicFile, CommitGivesTheNameOrRemovesTheTemporary) {
  const testing::ScratchDir scratch;
  const fs::path temporary = scratch.path() / "a.tmp";
  std::ofstream(temporary) << "content";
  commit_file(temporary, scratch.path() / "a");
  EXPECT_EQ(read_file(scratch.path() / "a"), "content");
  EXPECT_FALSE(fs::exists(temporary));

  std::ofstream(temporary) << "content";
  fs::create_directories(scratch.path() / "folder" / "not_empty");
  EXPECT_THROW(commit_file(temporary, scratch.path() / "folder"), std::runtime_error);
  EXPECT_FALSE(fs::exists(temporary));
}

class AtomicWriterTest : public ::testing::Test {
 protected:
  AtomicWriterTest() { write_file_atomically(path_, "old"); }

  void expect_alone(const std::string& content) const {
    EXPECT_EQ(read_file(path_), content);
    EXPECT_EQ(count_files(scratch_.path()), 1U);
  }

  const testing::ScratchDir scratch_;
  const fs::path path_ = scratch_.path() / "a.csv";
};

TEST_F(AtomicWriterTest, GivesTheNameToTheWholeTextAlone) {
  std::string text;
  AtomicWriter writer(path_);
  for (int i = 0; i < 100'000; ++i) {  // more than one block
    const std::string line = std::to_string(i) + "\n";
    writer.write(line);
    text += line;
  }
  EXPECT_EQ(read_file(path_), "old");
  EXPECT_EQ(writer.commit(), sha256(text));
  expect_alone(text);
}

TEST_F(AtomicWriterTest, LeavesNothingBehindIfItIsNotCommitted) {
  {
    AtomicWriter writer(path_);
    writer.write("new");
    EXPECT_EQ(count_files(scratch_.path()), 2U);
  }
  expect_alone("old");
}

TEST_F(AtomicWriterTest, FullDiskKeepsTheOldFileAndLeavesNoTemporary) {
  {
    AtomicWriter writer(path_);
    writer.write(std::string(10'000, 'x'));
    const testing::FullDisk full(4096);
    EXPECT_THROW(writer.commit(), IoError);
  }
  expect_alone("old");
}

TEST(AtomicFile, RemovesOnlyTemporaries) {
  const testing::ScratchDir scratch;
  for (const char* name : {"a.tmp", "b.17.0.tmp", "keep.h5", "tmp"})
    std::ofstream(scratch.path() / name) << "x";
  fs::create_directory(scratch.path() / "folder.tmp");
  remove_temporaries(scratch.path());
  EXPECT_FALSE(fs::exists(scratch.path() / "a.tmp"));
  EXPECT_FALSE(fs::exists(scratch.path() / "b.17.0.tmp"));
  EXPECT_EQ(count_files(scratch.path()), 3U);
  EXPECT_THROW(remove_temporaries(scratch.path() / "absent"), std::runtime_error);
}

}  // namespace
}  // namespace q3d::manifests
