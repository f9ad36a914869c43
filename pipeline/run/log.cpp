#include "pipeline/run/log.h"

#include <mutex>
#include <utility>

namespace q3d::pipeline::run {
namespace {

struct Log {
  std::mutex mutex;  // guards the other variables and serialises calls of the sink
  LogSink* sink = nullptr;
};

Log& the_log() {
  static Log log;
  return log;
}

LogSink* exchange_sink(LogSink* sink) {
  const std::lock_guard lock(the_log().mutex);
  return std::exchange(the_log().sink, sink);
}

void write(LogLevel level, std::string_view line) {
  const std::lock_guard lock(the_log().mutex);
  if (the_log().sink != nullptr) the_log().sink->write(level, line);
}

}  // namespace

LogTo::LogTo(LogSink& sink) : before_(exchange_sink(&sink)) {}

LogTo::~LogTo() {
  exchange_sink(before_);
}

void log_info(std::string_view line) {
  write(LogLevel::info, line);
}

void log_note(std::string_view line) {
  write(LogLevel::note, line);
}

void log_warning(std::string_view line) {
  write(LogLevel::warning, line);
}

}  // namespace q3d::pipeline::run
