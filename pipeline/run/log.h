// The log receives the library's messages. The library itself never prints. It hands each line to a sink,
// which the program sets. The command line writes the lines to stderr, a test collects them, and without a
// sink they are dropped.
//
// This is not spdlog, because a run writes some ten such lines. spdlog is built on fmt, and LibTorch ships an
// fmt of its own that must not meet another one at link time (cmake/Q3dTargets.cmake says how they are kept
// apart); three functions are not worth that risk.
#pragma once

#include <string_view>

namespace q3d::pipeline::run {

enum class LogLevel {
  info,     // what the run works on: "1200 candidates in 3 units"
  note,     // something in the input that a person may want to check
  warning,  // the run continues, but probably not as intended
};

// Takes one line at a time, without its line feed. Calls never overlap, even from different threads.
class LogSink {
 public:
  virtual ~LogSink() = default;
  virtual void write(LogLevel level, std::string_view line) = 0;
};

// Sends the lines of the whole process to `sink` as long as this object lives. Then the previous sink is used
// again. The sink must outlive it.
class LogTo {
 public:
  explicit LogTo(LogSink& sink);
  ~LogTo();
  LogTo(const LogTo&) = delete;
  LogTo& operator=(const LogTo&) = delete;

 private:
  LogSink* before_;
};

// These may be called in any thread, but not from LogSink::write.
void log_info(std::string_view line);
void log_note(std::string_view line);
void log_warning(std::string_view line);

}  // namespace q3d::pipeline::run
