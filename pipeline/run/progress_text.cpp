#include "pipeline/run/progress_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace q3d::pipeline::run {
namespace {

constexpr int kMostCells = 24;  // cells of the bar
constexpr int kLeastCells = 8;
constexpr const char* kBlue = "\033[34m";
constexpr const char* kPlain = "\033[0m";

std::int64_t percent(const ProgressState& state) {
  return state.total > 0 ? 100 * state.done / state.total : 100;
}

// Returns the rate and the time, each after `separator`.
std::string times(const ProgressState& state, const char* separator) {
  std::string text;
  if (state.per_second > 0) text += fmt::format("{}{:.1f}/s", separator, state.per_second);
  if (state.is_last) {
    text += separator + human_duration(state.elapsed_s);
  } else if (state.per_second > 0) {
    const double left_s = static_cast<double>(state.total - state.done) / state.per_second;
    text += separator + human_duration(left_s) + " left";
  }
  return text;
}

}  // namespace

std::string human_duration(double seconds) {
  const auto whole = static_cast<std::int64_t>(std::llround(seconds));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole % 3600 / 60);
}

std::string progress_line(const ProgressState& state) {
  std::string text = fmt::format("{}: {} / {} ({} %)", state.what, state.done, state.total, percent(state));
  text += times(state, ", ");
  return state.details.empty() ? text : text + "; " + state.details;
}

std::string progress_bar(const ProgressState& state, int columns, bool has_colour) {
  const std::string head = state.what + " [";
  std::string tail = fmt::format("] {} %  {}/{}", percent(state), state.done, state.total);
  tail += times(state, "  ");
  if (!state.details.empty()) tail += "  " + state.details;
  const int room = columns - 1 - static_cast<int>(head.size()) - static_cast<int>(tail.size());
  const int cells = std::clamp(room, kLeastCells, kMostCells);
  const auto filled = static_cast<std::size_t>(
      state.total > 0 ? std::min<std::int64_t>(cells, state.done * cells / state.total) : cells);
  const std::string full(filled, '#');
  const std::string rest(static_cast<std::size_t>(cells) - filled, '.');
  const std::size_t before_tail = head.size() + static_cast<std::size_t>(cells);
  const auto width = static_cast<std::size_t>(std::max(columns - 1, 0));
  tail.resize(std::min(tail.size(), width > before_tail ? width - before_tail : 0));
  return has_colour ? head + kBlue + full + kPlain + rest + tail : head + full + rest + tail;
}

}  // namespace q3d::pipeline::run
