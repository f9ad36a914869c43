#include "filters/adaptation/schedule.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace q3d::filters::adaptation {
namespace {

void require_at_least(int value, int least, const char* name) {
  if (value >= least) return;
  throw std::invalid_argument(
      fmt::format("schedule of adaptation: {} is {}, expected {} or more", name, value, least));
}

}  // namespace

bool holds_out(const Schedule& schedule) {
  return std::find(schedule.held_out.begin(), schedule.held_out.end(), true) != schedule.held_out.end();
}

void check(const Schedule& schedule) {
  require_at_least(schedule.iterations, 0, "iterations");
  require_at_least(schedule.gain_window, 1, "gain_window");
  require_at_least(schedule.patience, 0, "patience");
}

double relative_gain(std::span<const double> curve, int window) {
  if (curve.empty()) throw std::invalid_argument("relative_gain: the curve is empty");
  double least = std::numeric_limits<double>::infinity();
  const std::size_t end = std::min(curve.size(), static_cast<std::size_t>(window) + 1);
  for (std::size_t i = 1; i < end; ++i) {
    if (std::isfinite(curve[i])) least = std::min(least, curve[i]);
  }
  if (std::isinf(least)) return std::numeric_limits<double>::quiet_NaN();
  return curve[0] > 0 ? (curve[0] - least) / curve[0] : 0.0;
}

bool is_finished(const Schedule& schedule, std::span<const double> curve, int best) {
  const int taken = static_cast<int>(curve.size()) - 1;
  if (taken >= schedule.iterations) return true;
  if (holds_out(schedule) && schedule.patience > 0 && taken - best >= schedule.patience) return true;
  if (schedule.stop_below > 0.0 && curve.back() < schedule.stop_below) return true;
  return schedule.min_gain > 0.0 && taken == schedule.gain_window &&
         relative_gain(curve, schedule.gain_window) < schedule.min_gain;
}

}  // namespace q3d::filters::adaptation
