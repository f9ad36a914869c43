// Shows the progress of long work on stderr: a bar that is redrawn on a terminal, and occasional plain lines
// elsewhere.
#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <string>

#include "pipeline/run/progress_text.h"

namespace q3d::pipeline::run {

// Shows done / total, rate and time left. Thread-safe. Work that an earlier run had finished is counted as
// done but not in the rate.
class Progress {
 public:
  Progress(std::string what, std::int64_t total, bool quiet = false);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void advance(std::int64_t count, bool from_earlier_run = false);
  // Advances, and shows `details` after the numbers from now on. `count` may be 0, or negative to take back
  // work that was counted too early.
  void advance(std::int64_t count, bool from_earlier_run, std::string details);

 private:
  using Clock = std::chrono::steady_clock;
  void count(std::int64_t count, bool from_earlier_run);
  void draw_in_time();
  void draw(bool last);

  std::mutex mutex_;
  ProgressState state_;
  std::int64_t done_before_ = 0;
  bool quiet_;
  bool terminal_;
  bool has_drawn_ = false;
  Clock::time_point start_;
  Clock::time_point drawn_;
};

}  // namespace q3d::pipeline::run
