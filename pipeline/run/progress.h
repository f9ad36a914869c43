// Progress of long work: one line that redraws itself on a terminal, plain lines now and then elsewhere.
#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <string>

namespace q3d::pipeline::run {

// "41 s", "12 min 05 s", "3 h 20 min".
std::string human_duration(double seconds);

// Shows done / total, rate and time left on stderr. Thread-safe. Work that an earlier run had finished is
// counted as done but not in the rate.
class Progress {
 public:
  Progress(std::string what, std::int64_t total, bool quiet = false);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void advance(std::int64_t count, bool from_earlier_run = false);

 private:
  using Clock = std::chrono::steady_clock;
  void draw(bool last);

  std::mutex mutex_;
  std::string what_;
  std::int64_t total_;
  std::int64_t done_ = 0;
  std::int64_t done_before_ = 0;
  bool quiet_;
  bool terminal_;
  Clock::time_point start_;
  Clock::time_point drawn_;
};

}  // namespace q3d::pipeline::run
