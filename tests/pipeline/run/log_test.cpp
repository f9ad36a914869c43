#include "pipeline/run/log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace q3d::pipeline::run {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;

class Collected : public LogSink {
 public:
  void write(LogLevel level, std::string_view line) override { lines.emplace_back(level, line); }
  std::vector<std::pair<LogLevel, std::string>> lines;
};

TEST(Log, TheLibraryPrintsNothingByItself) {
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  log_info("a");
  log_note("b");
  log_warning("c");
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

TEST(Log, LinesGoToTheSinkOfTheMomentWithTheirLevel) {
  Collected outer;
  Collected inner;
  const LogTo to_outer(outer);
  log_info("4 candidates");
  {
    const LogTo to_inner(inner);
    log_note("one of them is odd");
  }
  log_warning("no GPU");
  EXPECT_THAT(outer.lines,
              ElementsAre(Pair(LogLevel::info, "4 candidates"), Pair(LogLevel::warning, "no GPU")));
  EXPECT_THAT(inner.lines, ElementsAre(Pair(LogLevel::note, "one of them is odd")));
}

TEST(Log, CallsOfManyThreadsDoNotOverlap) {
  constexpr int kThreads = 8, kLines = 500;
  Collected sink;  // has no lock of its own
  const LogTo to(sink);
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([] {
      for (int i = 0; i < kLines; ++i) log_info("line");
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(sink.lines.size(), static_cast<std::size_t>(kThreads * kLines));
}

}  // namespace
}  // namespace q3d::pipeline::run
