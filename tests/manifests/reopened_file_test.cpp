// A network disk's server forgets an open file, whose content may be another one by then.
#include "manifests/reopened_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <fstream>
#include <functional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "manifests/atomic_file.h"
#include "manifests/table.h"
#include "manifests/table_reader.h"
#include "tests/support/failing_io.h"
#include "tests/support/paths.h"

namespace q3d::manifests {
namespace {

using testing::Call;
using ::testing::ElementsAre;
using testing::FailingIo;

std::string read(const ReopenedFile& file, std::uint64_t offset, std::size_t count) {
  std::string text(count, ' ');
  file.read_at(offset, std::as_writable_bytes(std::span(text)));
  return text;
}

class Reopened : public ::testing::Test {
 protected:
  Reopened() { std::ofstream(path_) << "0123456789"; }

  // Returns bytes that are read after the server has forgotten the file and `meanwhile` has happened. `name`
  // is the kernel's name of the open file by then.
  std::string later(const std::function<void()>& meanwhile, const char* name = "/file") const {
    const ReopenedFile file(path_);
    meanwhile();
    const FailingIo io(Call::read_forgotten, name, ESTALE);
    return read(file, 4, 6);
  }
  void write_again() const {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));  // a tick of the file system's clock
    std::ofstream(path_) << "9876543210";
  }

  testing::ScratchDir scratch_;
  std::filesystem::path path_ = scratch_.path() / "file";
};

TEST_F(Reopened, IsReadOnIfItIsTheSame) {
  EXPECT_EQ(later([] {}), "456789");
}

TEST_F(Reopened, IsRefusedIfItWasWritten) {
  EXPECT_THROW(later([this] { write_again(); }), IoError);
}

TEST_F(Reopened, IsRefusedIfItWasReplacedByAFileOfTheSameTime) {
  const auto time = std::filesystem::last_write_time(path_);
  const auto replace = [&] {
    write_file_atomically(path_, "9876543210");
    std::filesystem::last_write_time(path_, time);
  };
  EXPECT_THROW(later(replace, "/file (deleted)"), IoError);
}

TEST_F(Reopened, IsRefusedIfTheServerForgetsItAgainAndAgain) {
  const ReopenedFile file(path_);
  const FailingIo io(Call::read, "/file", ESTALE);
  EXPECT_THROW(read(file, 0, 1), IoError);
}

TEST_F(Reopened, ManyThreadsReadWhatTheyAskFor) {
  const ReopenedFile file(path_);
  const FailingIo io(Call::read_forgotten, "/file", ESTALE);
  std::atomic<int> wrong = 0;
  std::vector<std::jthread> threads;
  for (std::size_t i = 0; i < 8; ++i) {
    threads.emplace_back([&, i] {
      for (int n = 0; n < 100; ++n)
        wrong += read(file, i, 2) == std::string("0123456789").substr(i, 2) ? 0 : 1;
    });
  }
  threads.clear();
  EXPECT_EQ(wrong, 0);
  EXPECT_GE(io.failures(), 1);
}

// Training keeps its shards open for days.
TEST_F(Reopened, ATableIsReadOn) {
  Table table;
  table.rows = 2;
  table.text["name"] = {"lynx", "okapi"};
  write_table(path_, table);
  const TableReader reader(path_);
  const FailingIo io(Call::read_forgotten, "/file", ESTALE);
  EXPECT_THAT(reader.text("name", 0, 2), ElementsAre("lynx", "okapi"));
  EXPECT_EQ(io.failures(), 1);
}

}  // namespace
}  // namespace q3d::manifests
