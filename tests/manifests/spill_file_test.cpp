#include "manifests/spill_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "manifests/spill_bytes.h"
#include "tests/support/paths.h"

namespace q3d::manifests {
namespace {

std::vector<std::byte> bytes_of(std::string_view text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

TEST(SpillFile, GivesBackWhatWasAppended) {
  const testing::ScratchDir scratch;
  SpillFile file(scratch.path());
  EXPECT_EQ(file.append(bytes_of("abc")), 0U);
  EXPECT_EQ(file.append(bytes_of("")), 3U);
  EXPECT_EQ(file.append(bytes_of("defg")), 3U);
  EXPECT_EQ(file.size(), 7U);
  std::vector<std::byte> read(4);
  file.read(2, read);
  EXPECT_EQ(read, bytes_of("cdef"));
  EXPECT_THROW(file.read(5, read), IoError) << "beyond the end";
}

TEST(SpillFile, LeavesNothingInItsFolder) {
  const testing::ScratchDir scratch;
  SpillFile file(scratch.path());
  file.append(bytes_of("abc"));
  EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
  EXPECT_THROW(SpillFile(scratch.path() / "absent"), IoError);
}

TEST(SpillBytes, KeepEveryBit) {
  std::vector<std::byte> bytes;
  BytesWriter write(bytes);
  write(std::string("a\0b", 3));
  write(-0.0);
  write(std::numeric_limits<double>::denorm_min());
  write(std::string());
  std::span<const std::byte> rest = bytes;
  BytesReader read(rest);
  std::string text;
  double number = 1.0;
  read(text);
  EXPECT_EQ(text, std::string("a\0b", 3));
  read(number);
  EXPECT_TRUE(std::signbit(number));
  read(number);
  EXPECT_EQ(number, std::numeric_limits<double>::denorm_min());
  read(text);
  EXPECT_EQ(text, "");
  EXPECT_TRUE(rest.empty());
  EXPECT_THROW(read(number), std::out_of_range);
}

}  // namespace
}  // namespace q3d::manifests
