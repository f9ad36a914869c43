#include "pipeline/device/device_worker.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

namespace q3d::pipeline::device {
namespace {

constexpr int kThreads = 8;
constexpr int kJobs = 200;

// Two jobs that overlapped would lose counts, for the numbers have no lock of their own.
TEST(DeviceWorkerThreads, JobsOfManyThreadsRunOneAtATimeAndInTheOrderOfEachThread) {
  std::vector<std::vector<int>> seen(kThreads);
  std::vector<std::thread::id> ran_on;
  {
    DeviceWorker device;
    std::vector<std::thread> threads;
    for (int t = 0; t < kThreads; ++t) {
      threads.emplace_back([&, t] {
        for (int i = 0; i < kJobs; ++i) {
          device.post([&seen, &ran_on, t, i] {
            seen[static_cast<std::size_t>(t)].push_back(i);
            ran_on.push_back(std::this_thread::get_id());
          });
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
  }  // finishes what was posted
  ASSERT_EQ(ran_on.size(), static_cast<std::size_t>(kThreads * kJobs));
  for (const std::thread::id& id : ran_on) EXPECT_EQ(id, ran_on.front());
  for (const std::vector<int>& numbers : seen) {
    ASSERT_EQ(numbers.size(), static_cast<std::size_t>(kJobs));
    for (int i = 0; i < kJobs; ++i) EXPECT_EQ(numbers[static_cast<std::size_t>(i)], i);
  }
}

TEST(DeviceWorkerThreads, WhatAJobWroteIsSeenByTheThreadThatWaitedForIt) {
  DeviceWorker device;
  std::atomic<int> right = 0;
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < kJobs; ++i) {
        int value = -1;
        device.run([&value, t, i] { value = t * kJobs + i; });
        right += value == t * kJobs + i;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(right, kThreads * kJobs);
}

}  // namespace
}  // namespace q3d::pipeline::device
