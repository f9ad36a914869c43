// Formats progress, without a clock or a terminal.
#pragma once

#include <cstdint>
#include <string>

namespace q3d::pipeline::run {

// Returns "41 s", "12 min 05 s" or "3 h 20 min".
std::string human_duration(double seconds);

struct ProgressState {
  std::string what;  // "candidates"
  std::int64_t done = 0;
  std::int64_t total = 0;
  double per_second = 0.0;  // 0 = not known yet
  double elapsed_s = 0.0;
  std::string details{};  // further text; may be empty
  bool is_last = false;   // shows the elapsed time instead of the time left
};

// Returns a line for files and pipes: "candidates: 12 / 96 (12 %), 3.4/s, 24 s left; DETAILS".
std::string progress_line(const ProgressState& state);

// Returns a line for a terminal, with a bar, of less than `columns` characters. A longer line is cut at the
// end.
std::string progress_bar(const ProgressState& state, int columns, bool has_colour);

}  // namespace q3d::pipeline::run
