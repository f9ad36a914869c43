#include "pipeline/statistics/numbers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>

namespace q3d::pipeline::statistics {

nlohmann::ordered_json rounded(double value, int digits) {
  if (!std::isfinite(value)) return nullptr;
  return std::strtod(fmt::format("{:.{}g}", value, digits).c_str(), nullptr);
}

nlohmann::ordered_json rounded(const std::optional<double>& value, int digits) {
  return value ? rounded(*value, digits) : nlohmann::ordered_json(nullptr);
}

std::optional<Share> share_of(std::int64_t part, std::int64_t whole) {
  if (whole <= 0) return std::nullopt;
  constexpr double kZ = 1.959963984540054;  // 97.5 % quantile of the normal distribution
  const auto n = static_cast<double>(whole);
  const double p = static_cast<double>(part) / n;
  const double scale = 1.0 + kZ * kZ / n;
  const double middle = (p + kZ * kZ / (2.0 * n)) / scale;
  const double half = kZ / scale * std::sqrt(p * (1.0 - p) / n + kZ * kZ / (4.0 * n * n));
  return Share{p, std::max(0.0, middle - half), std::min(1.0, middle + half)};
}

std::optional<double> quantile(std::vector<double>& values, double q) {
  if (values.empty()) return std::nullopt;
  std::sort(values.begin(), values.end());
  const double at = q * static_cast<double>(values.size() - 1);
  const auto first = static_cast<std::size_t>(at);
  const std::size_t second = std::min(first + 1, values.size() - 1);
  return values[first] + (at - static_cast<double>(first)) * (values[second] - values[first]);
}

Histogram::Histogram(double from, double to, int bins)
    : low(from), high(to), counts(static_cast<std::size_t>(std::max(bins, 1)), 0) {
  if (!(high > low)) throw std::invalid_argument("Histogram: its upper end must lie above its lower end");
}

void Histogram::add(double value) {
  if (std::isnan(value)) return;
  if (value < low) {
    ++below;
  } else if (value > high) {
    ++beyond;
  } else {
    const double place = (value - low) / (high - low) * static_cast<double>(counts.size());
    ++counts[std::min(static_cast<std::size_t>(place), counts.size() - 1)];
  }
}

std::vector<std::size_t> spread_positions(std::size_t count, std::size_t most) {
  const std::size_t wanted = std::min(count, most);
  std::vector<std::size_t> positions;
  positions.reserve(wanted);
  for (std::size_t i = 0; i < wanted; ++i) positions.push_back(i * count / wanted);
  return positions;
}

}  // namespace q3d::pipeline::statistics
