#include "pipeline/run/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>

namespace q3d::pipeline::run {

std::string human_duration(double seconds) {
  const auto whole = static_cast<std::int64_t>(std::llround(seconds));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole % 3600 / 60);
}

Progress::Progress(std::string what, std::int64_t total, bool quiet)
    : what_(std::move(what)),
      total_(total),
      quiet_(quiet),
      terminal_(isatty(STDERR_FILENO) != 0),
      start_(Clock::now()),
      drawn_(start_) {}

Progress::~Progress() {
  const std::lock_guard lock(mutex_);
  if (!quiet_ && done_ > 0) draw(true);
}

void Progress::advance(std::int64_t count, bool from_earlier_run) {
  const std::lock_guard lock(mutex_);
  done_ += count;
  if (from_earlier_run) done_before_ += count;
  const std::chrono::duration<double> since = Clock::now() - drawn_;
  if (!quiet_ && done_ < total_ && since.count() >= (terminal_ ? 0.2 : 10.0)) draw(false);
}

void Progress::draw(bool last) {
  drawn_ = Clock::now();
  const double elapsed = std::chrono::duration<double>(drawn_ - start_).count();
  const double rate = elapsed > 0 ? static_cast<double>(done_ - done_before_) / elapsed : 0.0;
  std::string line =
      fmt::format("{}: {} / {} ({} %)", what_, done_, total_, total_ > 0 ? 100 * done_ / total_ : 100);
  if (rate > 0) line += fmt::format(", {:.1f}/s", rate);
  if (last) {
    line += ", " + human_duration(elapsed);
  } else if (rate > 0) {
    line += ", " + human_duration(static_cast<double>(total_ - done_) / rate) + " left";
  }
  fmt::print(stderr, "{}{}{}", terminal_ ? "\r\033[K" : "", line, terminal_ && !last ? "" : "\n");
  std::fflush(stderr);
}

}  // namespace q3d::pipeline::run
