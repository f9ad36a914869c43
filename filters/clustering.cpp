#include "filters/clustering.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>

#include "manifests/random.h"

namespace q3d::filters {
namespace {

// Row-major points or centres.
struct Rows {
  std::vector<double> values;
  std::size_t dimensions = 0;
  std::size_t count() const { return values.size() / dimensions; }
  std::span<const double> operator[](std::size_t i) const {
    return std::span(values).subspan(i * dimensions, dimensions);
  }
  std::span<double> operator[](std::size_t i) {
    return std::span(values).subspan(i * dimensions, dimensions);
  }
};

double squared_distance(std::span<const double> a, std::span<const double> b) {
  double sum = 0.0;
  for (std::size_t d = 0; d < a.size(); ++d) sum += (a[d] - b[d]) * (a[d] - b[d]);
  return sum;
}

// Returns the index that `at` (0 .. sum of weights) falls on. An index of weight 0 is never drawn while
// others are left.
std::size_t pick(const std::vector<double>& weights, double at) {
  std::size_t last = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (weights[i] <= 0) continue;
    last = i;
    at -= weights[i];
    if (at < 0) break;
  }
  return last;
}

// k-means++ (Arthur and Vassilvitskii 2007): each further centre is drawn by its squared distance to the
// nearest one so far.
Rows draw_centres(const Rows& points, std::size_t clusters, std::mt19937_64& random) {
  Rows centres{{}, points.dimensions};
  std::vector<double> weights(points.count(), 1.0);
  for (std::size_t c = 0; c < clusters; ++c) {
    double total = 0.0;
    for (const double weight : weights) total += weight;
    const auto chosen = points[pick(weights, manifests::uniform(random) * total)];
    centres.values.insert(centres.values.end(), chosen.begin(), chosen.end());
    for (std::size_t i = 0; i < weights.size(); ++i) {
      const double distance = squared_distance(points[i], chosen);
      weights[i] = c == 0 ? distance : std::min(weights[i], distance);
    }
  }
  return centres;
}

struct Clustering {
  std::vector<int> labels;
  std::vector<double> distances;  // squared, to the own centre
  double inertia = std::numeric_limits<double>::infinity();
};

Clustering assign(const Rows& points, const Rows& centres) {
  Clustering result{std::vector<int>(points.count()), std::vector<double>(points.count()), 0.0};
  for (std::size_t i = 0; i < points.count(); ++i) {
    result.distances[i] = std::numeric_limits<double>::infinity();
    for (std::size_t c = 0; c < centres.count(); ++c) {
      const double distance = squared_distance(points[i], centres[c]);
      if (distance < result.distances[i]) {
        result.distances[i] = distance;
        result.labels[i] = static_cast<int>(c);
      }
    }
    result.inertia += result.distances[i];
  }
  return result;
}

// Computes the means of the clusters. An empty cluster restarts at the point that lies farthest from its own
// centre.
Rows means(const Rows& points, Clustering& clustering, std::size_t clusters) {
  Rows centres{std::vector<double>(clusters * points.dimensions), points.dimensions};
  std::vector<std::size_t> counts(clusters);
  for (std::size_t i = 0; i < points.count(); ++i) {
    const auto c = static_cast<std::size_t>(clustering.labels[i]);
    ++counts[c];
    for (std::size_t d = 0; d < points.dimensions; ++d) centres[c][d] += points[i][d];
  }
  for (std::size_t c = 0; c < clusters; ++c) {
    if (counts[c] > 0) {
      for (double& value : centres[c]) value /= static_cast<double>(counts[c]);
      continue;
    }
    const auto farthest = std::max_element(clustering.distances.begin(), clustering.distances.end());
    const auto point = points[static_cast<std::size_t>(farthest - clustering.distances.begin())];
    std::copy(point.begin(), point.end(), centres[c].begin());
    *farthest = 0.0;
  }
  return centres;
}

Clustering run_once(const Rows& points, const KMeansOptions& options, std::mt19937_64& random) {
  const auto clusters = static_cast<std::size_t>(options.clusters);
  Clustering current = assign(points, draw_centres(points, clusters, random));
  for (int iteration = 0; iteration < options.iterations_max; ++iteration) {
    Clustering next = assign(points, means(points, current, clusters));
    const bool settled = next.labels == current.labels;
    current = std::move(next);
    if (settled) break;
  }
  return current;
}

double pairs(double n) {
  return n * (n - 1) / 2;
}

template <typename Key>
double sum_of_pairs(const std::map<Key, int>& counts) {
  double sum = 0.0;
  for (const auto& [key, count] : counts) sum += pairs(count);
  return sum;
}

}  // namespace

std::vector<int> k_means(std::span<const float> points, int dimensions, const KMeansOptions& options) {
  if (dimensions < 1 || points.size() % static_cast<std::size_t>(dimensions) != 0 || options.clusters < 1 ||
      options.restarts < 1 || options.iterations_max < 1) {
    throw std::invalid_argument(
        "k_means: dimensions, clusters, restarts and iterations must be 1 or more, and " +
        std::to_string(points.size()) + " numbers a multiple of " + std::to_string(dimensions));
  }
  const Rows rows{{points.begin(), points.end()}, static_cast<std::size_t>(dimensions)};
  if (rows.count() < static_cast<std::size_t>(options.clusters)) {
    throw std::invalid_argument("k_means: " + std::to_string(rows.count()) + " points cannot form " +
                                std::to_string(options.clusters) + " clusters");
  }
  if (!std::all_of(points.begin(), points.end(), [](float value) { return std::isfinite(value); })) {
    throw std::invalid_argument("k_means: a coordinate is not finite");
  }
  std::mt19937_64 random(options.seed);
  Clustering best;
  for (int restart = 0; restart < options.restarts; ++restart) {
    Clustering candidate = run_once(rows, options, random);
    if (candidate.inertia < best.inertia) best = std::move(candidate);
  }
  return best.labels;
}

double adjusted_rand_index(std::span<const int> a, std::span<const int> b) {
  if (a.size() != b.size() || a.empty()) {
    throw std::invalid_argument("adjusted_rand_index: got " + std::to_string(a.size()) + " and " +
                                std::to_string(b.size()) + " labels, expected equal numbers above 0");
  }
  std::map<int, int> count_a;
  std::map<int, int> count_b;
  std::map<std::pair<int, int>, int> count_both;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ++count_a[a[i]];
    ++count_b[b[i]];
    ++count_both[{a[i], b[i]}];
  }
  const double all = pairs(static_cast<double>(a.size()));
  const double in_a = sum_of_pairs(count_a);
  const double in_b = sum_of_pairs(count_b);
  const double most = (in_a + in_b) / 2;
  const double expected = all > 0 ? in_a * in_b / all : 0.0;
  // Only two equal partitions that are trivial (one group, or all apart) leave nothing to correct.
  if (most == expected) return 1.0;
  return (sum_of_pairs(count_both) - expected) / (most - expected);
}

}  // namespace q3d::filters
