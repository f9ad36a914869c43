#include "manifests/block_reader.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <string>
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

TEST_F(LineReaderTest, GoesOnAfterTheServerForgotTheFile) {
  const std::string text = std::string(500'000, 'x') + "\nlast\n";
  write_file_atomically(scratch_.path() / "file", text);
  LineReader reader(scratch_.path() / "file");
  const testing::FailingIo io(testing::Call::read_forgotten, "/file", ESTALE);
  EXPECT_EQ(reader.next()->size(), 500'000U);
  EXPECT_EQ(reader.next(), "last");
  EXPECT_EQ(io.failures(), 1);
}

TEST_F(LineReaderTest, RefusesWhatIsNoFile) {
  EXPECT_THROW(LineReader(scratch_.path() / "absent"), IoError);
  EXPECT_THROW(LineReader(scratch_.path()), IoError);
}

}  // namespace
}  // namespace q3d::manifests
