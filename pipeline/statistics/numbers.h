// Computes numbers in the form in which statistics.json holds them.
#pragma once

#include <nlohmann/json.hpp>

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace q3d::pipeline::statistics {

// Returns the number with this many significant digits, so that a page of 14,000 candidates stays small.
// Returns null for a number that is not finite.
nlohmann::ordered_json rounded(double value, int digits = 5);
nlohmann::ordered_json rounded(const std::optional<double>& value, int digits = 5);

// A share of `whole` with its 95 % interval by Wilson's formula (Wilson 1927). The numbers are null if whole
// is 0.
struct Share {
  double share = 0.0, low = 0.0, high = 0.0;
};
std::optional<Share> share_of(std::int64_t part, std::int64_t whole);

// Returns the linearly interpolated quantile (numpy's default), or nothing for an empty list. Sorts the
// values.
std::optional<double> quantile(std::vector<double>& values, double q);

// A histogram with bins of equal width from `low` to `high`; a value at `high` is in the last bin.
struct Histogram {
  double low = 0.0, high = 1.0;
  std::vector<std::int64_t> counts;
  std::int64_t below = 0, beyond = 0;  // number of values outside the bins
  Histogram(double from, double to, int bins);
  void add(double value);  // NaN is not counted
};

// Returns at most `most` of `count` positions, evenly spread and ascending.
std::vector<std::size_t> spread_positions(std::size_t count, std::size_t most);

}  // namespace q3d::pipeline::statistics
