#include "filters/bootstrap.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>

namespace q3d::filters {
namespace {

[[noreturn]] void refuse(const std::string& what) {
  throw std::invalid_argument("paired_bootstrap: " + what);
}

void check(std::span<const double> differences, std::span<const std::size_t> picture_of_item,
           const BootstrapOptions& options) {
  const std::size_t items = picture_of_item.size();
  if (items == 0 || differences.empty() || differences.size() % items != 0) {
    refuse("got " + std::to_string(differences.size()) + " differences of " + std::to_string(items) +
           " items, expected runs x items, both 1 or more");
  }
  if (!std::all_of(differences.begin(), differences.end(),
                   [](double value) { return std::isfinite(value); })) {
    refuse("a difference is not finite");
  }
  if (options.resamples < 1 || !(options.confidence > 0.0 && options.confidence < 1.0)) {
    refuse("resamples must be 1 or more and confidence between 0 and 1, got " +
           std::to_string(options.resamples) + " and " + std::to_string(options.confidence));
  }
}

// Sums over the items of each picture: all that a resample's mean depends on.
struct Pictures {
  std::vector<double> sums;    // pictures x runs
  std::vector<double> counts;  // items of each picture
  std::size_t runs = 0;
  std::size_t count() const { return counts.size(); }
};

Pictures gather(std::span<const double> differences, std::span<const std::size_t> picture_of_item) {
  Pictures pictures;
  const std::size_t items = picture_of_item.size();
  pictures.runs = differences.size() / items;
  pictures.counts.assign(1 + *std::max_element(picture_of_item.begin(), picture_of_item.end()), 0.0);
  if (pictures.count() > items) refuse("the pictures' numbers have gaps");
  pictures.sums.assign(pictures.count() * pictures.runs, 0.0);
  for (std::size_t i = 0; i < items; ++i) {
    pictures.counts[picture_of_item[i]] += 1.0;
    for (std::size_t r = 0; r < pictures.runs; ++r) {
      pictures.sums[picture_of_item[i] * pictures.runs + r] += differences[r * items + i];
    }
  }
  if (std::find(pictures.counts.begin(), pictures.counts.end(), 0.0) != pictures.counts.end()) {
    refuse("the pictures' numbers have gaps");
  }
  return pictures;
}

// 0 .. count - 1, the same on every machine (the standard's distributions are not). The bias is below
// count / 2^53.
std::size_t draw(std::mt19937_64& random, std::size_t count) {
  return static_cast<std::size_t>(static_cast<double>(random() >> 11) * 0x1p-53 * static_cast<double>(count));
}

double resampled_mean(const Pictures& pictures, std::mt19937_64& random, std::vector<double>& times_drawn) {
  std::fill(times_drawn.begin(), times_drawn.end(), 0.0);
  for (std::size_t r = 0; r < pictures.runs; ++r) times_drawn[draw(random, pictures.runs)] += 1.0;
  double sum = 0.0;
  double items = 0.0;
  for (std::size_t p = 0; p < pictures.count(); ++p) {
    const std::size_t picture = draw(random, pictures.count());
    items += pictures.counts[picture];
    for (std::size_t r = 0; r < pictures.runs; ++r) {
      sum += times_drawn[r] * pictures.sums[picture * pictures.runs + r];
    }
  }
  return sum / (items * static_cast<double>(pictures.runs));
}

// Linear interpolation between order statistics (numpy's default).
double quantile(const std::vector<double>& sorted, double fraction) {
  const double at = fraction * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (at - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

}  // namespace

BootstrapInterval paired_bootstrap(std::span<const double> differences,
                                   std::span<const std::size_t> picture_of_item,
                                   const BootstrapOptions& options) {
  check(differences, picture_of_item, options);
  const Pictures pictures = gather(differences, picture_of_item);
  std::mt19937_64 random(options.seed);
  std::vector<double> means(static_cast<std::size_t>(options.resamples));
  std::vector<double> times_drawn(pictures.runs);
  for (double& mean : means) mean = resampled_mean(pictures, random, times_drawn);
  std::sort(means.begin(), means.end());
  const double tail = (1.0 - options.confidence) / 2.0;
  double total = 0.0;
  for (const double difference : differences) total += difference;
  return {total / static_cast<double>(differences.size()), quantile(means, tail),
          quantile(means, 1.0 - tail)};
}

}  // namespace q3d::filters
