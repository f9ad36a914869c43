#include "pipeline/statistics/distributions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "manifests/enumerators.h"
#include "pipeline/statistics/numbers.h"

namespace q3d::pipeline::statistics {
namespace {

using nlohmann::ordered_json;

constexpr int kErrorBins = 60;
constexpr double kShownShare = 0.98;
constexpr double kBeyondTauHigh = 1.1;

// Returns the error at which the histogram of errors ends.
double last_error(std::vector<double> errors, const dataset::DatasetManifest& manifest) {
  double last = quantile(errors, kShownShare).value_or(1.0);
  for (const auto& [name, thresholds] : manifest.thresholds) {
    last = std::max(last, kBeyondTauHigh * thresholds.tau_high);
  }
  return last > 0.0 ? last : 1.0;
}

ordered_json quantiles(std::vector<double> values) {
  constexpr std::array<std::pair<const char*, double>, 7> kQuantiles{{{"min", 0.0},
                                                                      {"q05", 0.05},
                                                                      {"q25", 0.25},
                                                                      {"median", 0.5},
                                                                      {"q75", 0.75},
                                                                      {"q95", 0.95},
                                                                      {"max", 1.0}}};
  ordered_json object = ordered_json::object();
  for (const auto& [name, q] : kQuantiles) object[name] = rounded(quantile(values, q));
  return object;
}

ordered_json histogram_json(const Histogram& histogram) {
  return {{"low", rounded(histogram.low)},
          {"high", rounded(histogram.high)},
          {"beyond", histogram.beyond},
          {"counts", histogram.counts}};
}

}  // namespace

ordered_json error_histogram(const Facts& facts, const dataset::DatasetManifest& manifest) {
  std::vector<double> errors;
  for (const CandidateFacts& candidate : facts.candidates) {
    if (candidate.row.is_judged()) errors.push_back(candidate.row.judgement.initial_error);
  }
  if (errors.empty()) return nullptr;
  const double last = last_error(errors, manifest);
  std::vector<Histogram> by_verdict(manifests::verdict_names().size(), Histogram(0.0, last, kErrorBins));
  Histogram final_errors(0.0, last, kErrorBins);
  for (const CandidateFacts& candidate : facts.candidates) {
    if (!candidate.row.is_judged()) continue;
    const manifests::Judgement& judgement = candidate.row.judgement;
    by_verdict[static_cast<std::size_t>(judgement.verdict)].add(judgement.initial_error);
    if (manifests::is_kept(judgement.verdict)) final_errors.add(judgement.final_error);
  }
  ordered_json counts = ordered_json::object();
  std::int64_t beyond = 0;
  for (std::size_t v = 0; v < by_verdict.size(); ++v) {
    counts[std::string(manifests::verdict_names()[v])] = by_verdict[v].counts;
    beyond += by_verdict[v].beyond;
  }
  return {{"low", 0.0},       {"high", rounded(last, 9)}, {"judged", errors.size()},
          {"beyond", beyond}, {"counts", counts},         {"final_counts", final_errors.counts}};
}

ordered_json adaptation(const Facts& facts, std::size_t most) {
  std::vector<const CandidateFacts*> adapted;
  for (const CandidateFacts& candidate : facts.candidates) {
    if (candidate.row.is_judged() && candidate.row.judgement.iterations > 0) adapted.push_back(&candidate);
  }
  if (adapted.empty()) return nullptr;
  ordered_json iterations = ordered_json::array(), best = iterations, gain = iterations, before = iterations,
               after = iterations, kept = iterations;
  for (const std::size_t i : spread_positions(adapted.size(), most)) {
    const manifests::Judgement& judgement = adapted[i]->row.judgement;
    iterations.push_back(judgement.iterations);
    best.push_back(judgement.best_iteration);
    gain.push_back(rounded(judgement.gain, 4));
    before.push_back(rounded(judgement.initial_error, 4));
    after.push_back(rounded(judgement.final_error, 4));
    kept.push_back(manifests::is_kept(judgement.verdict) ? 1 : 0);
  }
  const std::size_t shown = iterations.size();
  return {
      {"adapted", adapted.size()},         {"shown", shown},          {"iterations", std::move(iterations)},
      {"best_iteration", std::move(best)}, {"gain", std::move(gain)}, {"before", std::move(before)},
      {"after", std::move(after)},         {"kept", std::move(kept)}};
}

ordered_json visible_keypoints(const Facts& facts) {
  std::array<std::int64_t, manifests::kNumKeypoints + 1> candidates{}, kept{};
  for (const CandidateFacts& candidate : facts.candidates) {
    if (!candidate.has_geometry) continue;
    ++candidates[static_cast<std::size_t>(candidate.visible)];
    if (candidate.row.label) ++kept[static_cast<std::size_t>(candidate.visible)];
  }
  return {{"candidates", candidates}, {"kept", kept}};
}

ordered_json trust_histogram(const Facts& facts) {
  Histogram histogram(0.0, 1.0, 20);
  bool is_measured = false;
  for (const CandidateFacts& candidate : facts.candidates) {
    const double trust = candidate.row.judgement.trust.combined;
    if (!candidate.row.label || !std::isfinite(trust)) continue;
    histogram.add(trust);
    is_measured = true;
  }
  return is_measured ? histogram_json(histogram) : ordered_json(nullptr);
}

ordered_json sizes(const Facts& facts) {
  std::vector<double> widths, heights, boxes;
  std::int64_t below = 0;
  for (const CandidateFacts& candidate : facts.candidates) {
    if (candidate.image_w_px > 0) {
      widths.push_back(candidate.image_w_px);
      heights.push_back(candidate.image_h_px);
    }
    if (!candidate.has_geometry) continue;
    boxes.push_back(std::max(candidate.box_w_px, candidate.box_h_px));
    below += boxes.back() < smal::kCropSidePx;
  }
  ordered_json object = {{"picture_width_px", quantiles(widths)},
                         {"picture_height_px", quantiles(heights)},
                         {"box_side_px", quantiles(boxes)},
                         {"boxes_below_crop", below}};
  if (boxes.empty()) return object;
  std::vector<double> sorted = boxes;
  Histogram histogram(0.0, std::max(1.0, *quantile(sorted, 0.99)), 30);
  for (const double side : boxes) histogram.add(side);
  object["box_side_histogram"] = histogram_json(histogram);
  return object;
}

}  // namespace q3d::pipeline::statistics
