#include "manifests/digest.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/stat.h>

#include <chrono>
#include <fstream>
#include <thread>
#include <vector>

#include "manifests/atomic_file.h"
#include "manifests/known_files.h"
#include "tests/support/paths.h"

namespace q3d::manifests {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

// These are the examples of FIPS 180-2, appendix B, and the empty string.
constexpr std::string_view kAbc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
constexpr std::string_view kEmpty = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
constexpr std::string_view kMillionA = "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0";

void write(const fs::path& path, std::string_view content, std::chrono::seconds age = 1h) {
  std::ofstream(path, std::ios::binary) << content;
  fs::last_write_time(path, fs::file_time_type::clock::now() - age);
}

TEST(Digest, AgreesWithTheStandard) {
  EXPECT_EQ(sha256(std::string_view("abc")), kAbc);
  EXPECT_EQ(sha256(std::string_view()), kEmpty);
  const testing::ScratchDir scratch;
  write(scratch.path() / "million", std::string(1'000'000, 'a'));
  EXPECT_EQ(sha256_file(scratch.path() / "million"), kMillionA);
  write(scratch.path() / "empty", "");
  EXPECT_EQ(sha256_file(scratch.path() / "empty"), kEmpty);
  EXPECT_THROW(sha256_file(scratch.path() / "absent"), std::runtime_error);
  EXPECT_THROW(sha256_file(scratch.path()), std::runtime_error);
}

TEST(Digest, OfAFileAcrossBlocksEqualsThatOfItsBytes) {
  const testing::ScratchDir scratch;
  std::string content((3 << 20) + 17, '\0');
  for (std::size_t i = 0; i < content.size(); ++i) content[i] = static_cast<char>((i * 2654435761U) >> 13);
  write(scratch.path() / "file", content);
  EXPECT_EQ(sha256_file(scratch.path() / "file"), sha256(content));
}

// A file whose content changes while path, size, mtime and inode stay: what only a cache overlooks.
class DigestCacheTest : public ::testing::Test {
 protected:
  void change_unnoticed(const fs::path& path, std::string_view content) {
    const auto time = fs::last_write_time(path);
    std::ofstream(path, std::ios::binary | std::ios::in) << content;
    fs::last_write_time(path, time);
  }
  testing::ScratchDir scratch_;
  fs::path cache_file_ = scratch_.path() / "digests.txt";
  fs::path file_ = scratch_.path() / "picture with spaces.jpg";
};

TEST_F(DigestCacheTest, RemembersAcrossSaveAndLoad) {
  write(file_, "abc");
  {
    DigestCache cache(cache_file_);
    EXPECT_EQ(cache.digest(file_), kAbc);
    cache.save();
  }
  change_unnoticed(file_, "xyz");
  DigestCache cache(cache_file_);
  EXPECT_EQ(cache.digest(file_), kAbc) << "the entry was not used";
  write(file_, "xyz", 2h);  // another mtime
  EXPECT_EQ(cache.digest(file_), sha256(std::string_view("xyz")));
}

TEST_F(DigestCacheTest, NoticesAnotherSizeAndAnotherInode) {
  write(file_, "abc");
  const auto time = fs::last_write_time(file_);
  DigestCache cache(cache_file_);
  EXPECT_EQ(cache.digest(file_), kAbc);
  std::ofstream(file_) << "abcd";
  fs::last_write_time(file_, time);
  EXPECT_EQ(cache.digest(file_), sha256(std::string_view("abcd")));

  const fs::path other = scratch_.path() / "other";
  std::ofstream(other) << "wxyz";
  fs::rename(other, file_);
  fs::last_write_time(file_, time);
  EXPECT_EQ(cache.digest(file_), sha256(std::string_view("wxyz")));
}

TEST_F(DigestCacheTest, DoesNotTrustAFileModifiedJustBefore) {
  write(file_, "abc", 0s);
  DigestCache cache(cache_file_);
  EXPECT_EQ(cache.digest(file_), kAbc);
  change_unnoticed(file_, "xyz");
  EXPECT_EQ(cache.digest(file_), sha256(std::string_view("xyz")));
}

TEST_F(DigestCacheTest, SaysWhereFilesLie) {
  const fs::path one = scratch_.path() / "one", same = scratch_.path() / "a name with spaces";
  write(one, "abc");
  write(same, "abc");
  DigestCache cache(cache_file_);
  cache.digest(one);
  cache.digest(same);
  cache.save();
  const auto files = read_known_files(cache_file_);
  const auto [first, last] = files.equal_range(std::string(kAbc));
  std::vector<fs::path> paths;
  for (auto file = first; file != last; ++file) paths.push_back(file->second);
  EXPECT_THAT(paths, ::testing::UnorderedElementsAre(one, same));
  EXPECT_TRUE(read_known_files(scratch_.path() / "absent").empty());
}

TEST_F(DigestCacheTest, DropsDamagedLinesOnly) {
  const fs::path second = scratch_.path() / "second";
  write(file_, "abc");
  write(second, "abc");
  {
    DigestCache cache(cache_file_);
    cache.digest(second);
    cache.digest(file_);
    cache.save();
  }
  std::string content = read_file(cache_file_);
  ASSERT_EQ(std::count(content.begin(), content.end(), '\n'), 2);
  EXPECT_LT(content.find("picture"), content.find("second")) << "lines are sorted by path";
  content[0] = content[0] == '0' ? '1' : '0';  // the first line's digest
  write_file_atomically(cache_file_, content + "torn");

  DigestCache cache(cache_file_);
  change_unnoticed(file_, "xyz");
  change_unnoticed(second, "xyz");
  EXPECT_EQ(cache.digest(file_), sha256(std::string_view("xyz"))) << "a damaged line was believed";
  EXPECT_EQ(cache.digest(second), kAbc) << "a whole line was dropped";
}

TEST_F(DigestCacheTest, SavesTheSameBytesInAnyOrderFromManyThreads) {
  std::vector<fs::path> files;
  for (int i = 0; i < 40; ++i) {
    files.push_back(scratch_.path() / ("file" + std::to_string(i)));
    write(files.back(), std::to_string(i));
  }
  DigestCache serial(scratch_.path() / "serial.txt");
  for (const auto& file : files) serial.digest(file);
  serial.save();
  DigestCache parallel(scratch_.path() / "parallel.txt");
  {
    std::vector<std::jthread> threads;
    for (std::size_t t = 0; t < 4; ++t) {
      threads.emplace_back([&, t] {
        for (std::size_t i = 0; i < files.size(); ++i)
          parallel.digest(files[(i * 7 + t * 11) % files.size()]);
      });
    }
  }
  parallel.save();
  EXPECT_EQ(read_file(scratch_.path() / "serial.txt"), read_file(scratch_.path() / "parallel.txt"));
}

}  // namespace
}  // namespace q3d::manifests
