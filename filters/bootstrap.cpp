#include "filters/bootstrap.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <stdexcept>
#include <string>

#include "manifests/random.h"

namespace q3d::filters {
namespace {

[[noreturn]] void refuse(const std::string& what) {
  throw std::invalid_argument("bootstrap: " + what);
}

void check(std::span<const double> values, std::span<const std::size_t> picture_of_item,
           const BootstrapOptions& options) {
  const std::size_t items = picture_of_item.size();
  if (items == 0 || values.empty() || values.size() % items != 0) {
    refuse("got " + std::to_string(values.size()) + " values of " + std::to_string(items) +
           " items, expected runs x items, both 1 or more");
  }
  if (options.resamples < 1 || !(options.confidence > 0.0 && options.confidence < 1.0)) {
    refuse("resamples must be 1 or more and confidence between 0 and 1, got " +
           std::to_string(options.resamples) + " and " + std::to_string(options.confidence));
  }
}

// Returns the number of pictures that the items belong to.
std::size_t count_pictures(std::span<const std::size_t> picture_of_item) {
  std::vector<bool> occurs(picture_of_item.size(), false);
  for (const std::size_t picture : picture_of_item) {
    if (picture >= occurs.size()) refuse("the pictures' numbers have gaps");
    occurs[picture] = true;
  }
  const std::size_t pictures = 1 + *std::max_element(picture_of_item.begin(), picture_of_item.end());
  const auto end = occurs.begin() + static_cast<std::ptrdiff_t>(pictures);
  if (std::find(occurs.begin(), end, false) != end) refuse("the pictures' numbers have gaps");
  return pictures;
}

// The values of one method, in the form that a resample's mean needs.
class PictureSums {
 public:
  // An item with NaN is not a member of the set.
  PictureSums(std::span<const double> values, std::span<const std::size_t> picture_of_item)
      : pictures_(count_pictures(picture_of_item)), runs_(values.size() / picture_of_item.size()) {
    sums_.assign(pictures_ * runs_, 0.0);
    counts_.assign(pictures_ * runs_, 0.0);
    const std::size_t items = picture_of_item.size();
    for (std::size_t i = 0; i < items; ++i) {
      for (std::size_t r = 0; r < runs_; ++r) {
        const double value = values[r * items + i];
        if (std::isnan(value)) continue;
        if (std::isinf(value)) refuse("a value is infinite");
        sums_[picture_of_item[i] * runs_ + r] += value;
        counts_[picture_of_item[i] * runs_ + r] += 1.0;
      }
    }
  }

  std::size_t pictures() const { return pictures_; }
  std::size_t runs() const { return runs_; }

  // Returns the mean of the members of the drawn pictures. Each member counts as often as its picture and its
  // run were drawn. NaN if there are no members.
  double mean(const std::vector<std::size_t>& drawn_pictures, const std::vector<double>& times_drawn) const {
    double sum = 0.0;
    double count = 0.0;
    for (const std::size_t picture : drawn_pictures) {
      for (std::size_t r = 0; r < runs_; ++r) {
        sum += times_drawn[r] * sums_[picture * runs_ + r];
        count += times_drawn[r] * counts_[picture * runs_ + r];
      }
    }
    return sum / count;
  }

 private:
  std::size_t pictures_;
  std::size_t runs_;
  std::vector<double> sums_;    // pictures x runs
  std::vector<double> counts_;  // pictures x runs
};

// Draws pictures and runs, and hands them to `statistic` until it gives a number.
template <typename Statistic>
double resample(std::size_t pictures, std::size_t runs, std::mt19937_64& random, const Statistic& statistic) {
  for (;;) {
    std::vector<double> times_drawn(runs, 0.0);
    for (std::size_t r = 0; r < runs; ++r) times_drawn[manifests::uniform_below(random, runs)] += 1.0;
    std::vector<std::size_t> drawn(pictures);
    for (std::size_t& picture : drawn) picture = manifests::uniform_below(random, pictures);
    const double value = statistic(drawn, times_drawn);
    if (!std::isnan(value)) return value;
  }
}

// Linear interpolation between order statistics (numpy's default).
double quantile(const std::vector<double>& sorted, double fraction) {
  const double at = fraction * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (at - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

template <typename Statistic>
BootstrapInterval interval(double whole, std::size_t pictures, std::size_t runs,
                           const BootstrapOptions& options, const Statistic& statistic) {
  std::mt19937_64 random(options.seed);
  std::vector<double> values(static_cast<std::size_t>(options.resamples));
  for (double& value : values) value = resample(pictures, runs, random, statistic);
  std::sort(values.begin(), values.end());
  const double tail = (1.0 - options.confidence) / 2.0;
  return {whole, quantile(values, tail), quantile(values, 1.0 - tail)};
}

}  // namespace

BootstrapInterval paired_bootstrap(std::span<const double> differences,
                                   std::span<const std::size_t> picture_of_item,
                                   const BootstrapOptions& options) {
  check(differences, picture_of_item, options);
  if (!std::all_of(differences.begin(), differences.end(),
                   [](double value) { return std::isfinite(value); })) {
    refuse("a difference is not finite");
  }
  const PictureSums sums(differences, picture_of_item);
  double total = 0.0;
  for (const double difference : differences) total += difference;
  return interval(total / static_cast<double>(differences.size()), sums.pictures(), sums.runs(), options,
                  [&](const auto& drawn, const auto& times_drawn) { return sums.mean(drawn, times_drawn); });
}

BootstrapInterval bootstrap_of_sets(std::span<const double> first, std::span<const double> second,
                                    std::span<const std::size_t> picture_of_item,
                                    const BootstrapOptions& options) {
  check(first, picture_of_item, options);
  check(second, picture_of_item, options);
  if (first.size() != second.size()) {
    refuse("got " + std::to_string(first.size()) + " values of the first set and " +
           std::to_string(second.size()) + " of the second, expected equal numbers");
  }
  const PictureSums of_first(first, picture_of_item);
  const PictureSums of_second(second, picture_of_item);
  const auto difference = [&](const std::vector<std::size_t>& drawn, const std::vector<double>& times_drawn) {
    return of_second.mean(drawn, times_drawn) - of_first.mean(drawn, times_drawn);
  };
  std::vector<std::size_t> all(of_first.pictures());
  std::iota(all.begin(), all.end(), std::size_t{0});
  const double whole = difference(all, std::vector<double>(of_first.runs(), 1.0));
  if (std::isnan(whole)) refuse("a set is empty");
  return interval(whole, of_first.pictures(), of_first.runs(), options, difference);
}

}  // namespace q3d::filters
