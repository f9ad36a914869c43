// One thread that owns the network: it takes units one by one and gives them back when it is done with them.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace q3d::pipeline::device {

// Runs jobs in the order they were posted, all on the same thread: LibTorch's CPU operators keep a pool of
// threads for each calling thread, and a task scheduler's workers would each grow their own.
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
