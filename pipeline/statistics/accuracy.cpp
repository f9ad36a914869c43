#include "pipeline/statistics/accuracy.h"

#include <array>
#include <cmath>

#include "loaders/keypoints/topology.h"
#include "pipeline/statistics/numbers.h"

namespace q3d::pipeline::statistics {
namespace {

using nlohmann::ordered_json;

// Thresholds are fractions of the crop's side. They end at a fifth, within which nearly every keypoint of a
// usable body lies.
constexpr int kSteps = 40;
constexpr double kLastThreshold = 0.2;

double threshold(int step) {
  return kLastThreshold * step / kSteps;
}

// Accumulates means over samples.
class Curve {
 public:
  void add(const Fit& fit) {
    std::array<int, kSteps + 1> within{};
    int visible = 0;
    for (const float distance : fit.distance) {
      if (std::isnan(distance)) continue;
      ++visible;
      for (int step = 0; step <= kSteps; ++step)
        within[static_cast<std::size_t>(step)] += distance < threshold(step);
    }
    if (visible == 0) return;
    for (std::size_t step = 0; step < within.size(); ++step) {
      pck_[step] += static_cast<double>(within[step]) / visible;
    }
    auc_ += fit.auc;
    ++samples_;
  }
  ordered_json json() const {
    if (samples_ == 0) return nullptr;
    const auto n = static_cast<double>(samples_);
    ordered_json pck = ordered_json::array();
    for (const double sum : pck_) pck.push_back(rounded(100.0 * sum / n, 5));
    return {{"samples", samples_}, {"auc", rounded(100.0 * auc_ / n, 5)}, {"pck", std::move(pck)}};
  }

 private:
  std::array<double, kSteps + 1> pck_{};
  double auc_ = 0.0;
  std::int64_t samples_ = 0;
};

}  // namespace

ordered_json accuracy(const Facts& facts) {
  Curve predictions, labels, before;
  for (const CandidateFacts& candidate : facts.candidates) {
    if (candidate.prediction && candidate.row.is_judged()) predictions.add(*candidate.prediction);
    if (candidate.label) labels.add(*candidate.label);
    if (candidate.label && candidate.prediction) before.add(*candidate.prediction);
  }
  ordered_json thresholds = ordered_json::array();
  for (int step = 0; step <= kSteps; ++step) thresholds.push_back(rounded(threshold(step)));
  return {{"normaliser", "crop"},
          {"thresholds", std::move(thresholds)},
          {"predictions", predictions.json()},
          {"labels", labels.json()},
          {"labels_before", before.json()}};
}

ordered_json keypoint_table(const Facts& facts) {
  struct Sums {
    std::int64_t visible = 0, kept = 0, with_prediction = 0;
    double before = 0.0, after = 0.0;
  };
  std::array<Sums, manifests::kNumKeypoints> sums{};
  for (const CandidateFacts& candidate : facts.candidates) {
    for (std::size_t k = 0; k < sums.size(); ++k) {
      if (candidate.prediction && !std::isnan(candidate.prediction->distance[k])) ++sums[k].visible;
      if (!candidate.label || std::isnan(candidate.label->distance[k])) continue;
      ++sums[k].kept;
      sums[k].after += candidate.label->distance[k];
      if (!candidate.prediction) continue;
      ++sums[k].with_prediction;
      sums[k].before += candidate.prediction->distance[k];
    }
  }
  const std::vector<std::string>& names = loaders::keypoints::topology("animal3d26").keypoints;
  ordered_json table = ordered_json::array();
  const auto mean = [](double sum, std::int64_t count) {
    return count == 0 ? ordered_json(nullptr) : rounded(sum / static_cast<double>(count));
  };
  for (std::size_t k = 0; k < sums.size(); ++k) {
    table.push_back({{"name", names[k]},
                     {"visible", sums[k].visible},
                     {"kept", sums[k].kept},
                     {"error_before", mean(sums[k].before, sums[k].with_prediction)},
                     {"error_after", mean(sums[k].after, sums[k].kept)}});
  }
  return table;
}

}  // namespace q3d::pipeline::statistics
