#include "manifests/block_reader.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <chrono>
#include <fstream>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "manifests/atomic_file.h"
#include "tests/support/failing_io.h"
#include "tests/support/paths.h"

namespace q3d::manifests {
namespace {

class LineReaderTest : public ::testing::Test {
 protected:
  std::vector<std::string> lines(std::string_view text) {
    write_file_atomically(scratch_.path() / "file", text);
    LineReader reader(scratch_.path() / "file");
    std::vector<std::string> all;
    while (const auto line = reader.next()) all.emplace_back(*line);
    was_whole_ = reader.was_whole();
    return all;
  }
  testing::ScratchDir scratch_;
  bool was_whole_ = false;
};

TEST_F(LineReaderTest, GivesEveryLineOnce) {
  EXPECT_EQ(lines("a\n\nb c\n"), (std::vector<std::string>{"a", "", "b c"}));
  EXPECT_TRUE(was_whole_);
  EXPECT_EQ(lines(""), std::vector<std::string>{});
  EXPECT_TRUE(was_whole_);
  EXPECT_EQ(lines("a\ntorn"), (std::vector<std::string>{"a", "torn"}));
  EXPECT_FALSE(was_whole_);
}

TEST_F(LineReaderTest, ReadsAcrossBlocks) {
  for (const std::size_t size : {std::size_t{1} << 18U, (std::size_t{1} << 18U) - 1, std::size_t{700'001}}) {
    std::vector<std::string> expected;
    std::string text;
    while (text.size() < size) {
      expected.emplace_back(std::min<std::size_t>(expected.size() * 97 % 5000, size - text.size() - 1), 'x');
      text += expected.back() + '\n';
    }
    ASSERT_EQ(text.size(), size);
    EXPECT_EQ(lines(text), expected);
    EXPECT_TRUE(was_whole_);
  }
}

// A network disk's server has forgotten the open file, and its content may be another one by now.
class StaleFile : public ::testing::Test {
 protected:
  StaleFile() { std::ofstream(path_) << "0123456789"; }

  // Returns what follows the first four bytes if the server forgets the file after them, and `meanwhile`
  // happens. `name` is the kernel's of the open file by then.
  std::string rest(const std::function<void()>& meanwhile, const char* name = "/file") const {
    BlockReader reader(path_);
    std::string text(4, ' ');
    reader.read(text);
    meanwhile();
    const testing::FailingIo io(testing::Call::read, name, ESTALE, 2);
    text.resize(100);
    text.resize(reader.read(text));
    return text;
  }
  void write_again() const {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));  // a tick of the file system's clock
    std::ofstream(path_) << "9876543210";
  }

  testing::ScratchDir scratch_;
  std::filesystem::path path_ = scratch_.path() / "file";
};

TEST_F(StaleFile, IsReadOnIfItIsTheSame) {
  EXPECT_EQ(rest([] {}), "456789");
}

TEST_F(StaleFile, IsRefusedIfItWasWritten) {
  EXPECT_THROW(rest([this] { write_again(); }), IoError);
}

TEST_F(StaleFile, IsRefusedIfItWasReplacedByAFileOfTheSameTime) {
  const auto time = std::filesystem::last_write_time(path_);
  const auto replace = [&] {
    write_file_atomically(path_, "9876543210");
    std::filesystem::last_write_time(path_, time);
  };
  EXPECT_THROW(rest(replace, "/file (deleted)"), IoError);
}

TEST_F(LineReaderTest, RefusesWhatIsNoFile) {
  EXPECT_THROW(LineReader(scratch_.path() / "absent"), IoError);
  EXPECT_THROW(LineReader(scratch_.path()), IoError);
}

}  // namespace
}  // namespace q3d::manifests
