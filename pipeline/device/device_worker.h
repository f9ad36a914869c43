// The thread that owns the network. It processes units one by one.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace q3d::pipeline::device {

// Runs jobs in the order in which they were posted, all on the same thread. LibTorch's CPU operators keep a
// thread pool for each calling thread, so every worker of a task scheduler would otherwise create its own
// pool.
class DeviceWorker {
 public:
  DeviceWorker();
  ~DeviceWorker();  // finishes the jobs that were posted
  DeviceWorker(const DeviceWorker&) = delete;
  DeviceWorker& operator=(const DeviceWorker&) = delete;

  void post(std::function<void()> job);        // must not throw
  void run(const std::function<void()>& job);  // waits for it and rethrows what it throws

 private:
  void work();

  std::mutex mutex_;
  std::condition_variable arrived_;
  std::deque<std::function<void()>> jobs_;
  bool closing_ = false;
  std::thread thread_;
};

}  // namespace q3d::pipeline::device
