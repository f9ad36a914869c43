#include "pipeline/run/progress.h"

#include <fmt/format.h>

#include <cstdio>
#include <utility>

#include "pipeline/run/printable.h"
#include "pipeline/run/terminal.h"

namespace q3d::pipeline::run {
namespace {

constexpr double kRedrawAfter_s = 0.2;
constexpr double kLineAfter_s = 10.0;

}  // namespace

Progress::Progress(std::string what, std::int64_t total, bool quiet)
    : quiet_(quiet), terminal_(terminal_of_stderr().redraws), start_(Clock::now()), drawn_(start_) {
  state_.what = std::move(what);
  state_.total = total;
}

Progress::~Progress() {
  const std::lock_guard lock(mutex_);
  if (!quiet_ && state_.done > 0) draw(true);
}

void Progress::advance(std::int64_t count, bool from_earlier_run) {
  const std::lock_guard lock(mutex_);
  this->count(count, from_earlier_run);
  draw_in_time();
}

void Progress::advance(std::int64_t count, bool from_earlier_run, std::string details) {
  const std::lock_guard lock(mutex_);
  this->count(count, from_earlier_run);
  state_.details = std::move(details);
  draw_in_time();
}

void Progress::count(std::int64_t count, bool from_earlier_run) {
  state_.done += count;
  if (from_earlier_run) done_before_ += count;
}

void Progress::draw_in_time() {
  if (quiet_ || state_.done >= state_.total) return;
  const double since_s = std::chrono::duration<double>(Clock::now() - drawn_).count();
  // On a terminal the first line is drawn at once, so that a user sees what the program is doing.
  if ((terminal_ && !has_drawn_) || since_s >= (terminal_ ? kRedrawAfter_s : kLineAfter_s)) draw(false);
}

void Progress::draw(bool last) {
  has_drawn_ = true;
  drawn_ = Clock::now();
  state_.elapsed_s = std::chrono::duration<double>(drawn_ - start_).count();
  state_.per_second =
      state_.elapsed_s > 0 ? static_cast<double>(state_.done - done_before_) / state_.elapsed_s : 0.0;
  state_.is_last = last;
  if (terminal_) {
    const Terminal terminal = terminal_of_stderr();
    draw_terminal_line(progress_bar(state_, terminal.columns, terminal.has_colour) + (last ? "\n" : ""));
  } else {
    fmt::print(stderr, "{}\n", progress_line(state_));
  }
  std::fflush(stderr);
}

}  // namespace q3d::pipeline::run
