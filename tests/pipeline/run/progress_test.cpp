#include "pipeline/run/progress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

namespace q3d::pipeline::run {
namespace {

TEST(Progress, CountsOfManyThreadsAddUp) {
  constexpr int kThreads = 8, kSteps = 500;
  ::testing::internal::CaptureStderr();
  {
    Progress progress("candidates", kThreads * kSteps);
    std::vector<std::thread> threads;
    for (int t = 0; t < kThreads; ++t) {
      threads.emplace_back([&progress, t] {
        for (int i = 0; i < kSteps; ++i) {
          if (t % 2 == 0) {
            progress.advance(1);
          } else {
            progress.advance(1, i % 2 == 0, "unit " + std::to_string(i));
          }
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
  }
  EXPECT_THAT(::testing::internal::GetCapturedStderr(), ::testing::HasSubstr("4000 / 4000"));
}

}  // namespace
}  // namespace q3d::pipeline::run
