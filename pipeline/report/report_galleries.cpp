#include "pipeline/report/report_galleries.h"

#include <openssl/evp.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>

#include "loaders/pictures/encode.h"
#include "manifests/digest.h"
#include "pipeline/dataset/explain.h"
#include "pipeline/report/overlay_choice.h"
#include "pipeline/run/interrupt.h"

namespace q3d::pipeline::report {
namespace {

using dataset::VerdictRow;
using nlohmann::ordered_json;

constexpr int kTilePx = 200;
constexpr int kJpegQuality = 82;
constexpr std::size_t kOpenGalleries = 2;

std::string data_uri(const cv::Mat& picture) {
  const std::vector<std::byte> jpeg = loaders::pictures::encode_jpeg(picture, kJpegQuality);
  std::string base64(4 * ((jpeg.size() + 2) / 3) + 1, '\0');
  const int length =
      EVP_EncodeBlock(reinterpret_cast<unsigned char*>(base64.data()),
                      reinterpret_cast<const unsigned char*>(jpeg.data()), static_cast<int>(jpeg.size()));
  base64.resize(static_cast<std::size_t>(length));
  return "data:image/jpeg;base64," + base64;
}

// Returns the `size` rows of least distance. Rows without a distance (NaN) are left out.
std::vector<VerdictRow> nearest(const std::vector<VerdictRow>& rows, std::size_t size,
                                const std::function<double(const VerdictRow&)>& distance) {
  std::vector<std::pair<double, const VerdictRow*>> order;
  for (const VerdictRow& row : rows) {
    const double value = distance(row);
    if (std::isfinite(value)) order.emplace_back(value, &row);
  }
  std::stable_sort(order.begin(), order.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<VerdictRow> chosen;
  for (std::size_t i = 0; i < std::min(size, order.size()); ++i) chosen.push_back(*order[i].second);
  return chosen;
}

std::vector<VerdictRow> by_chance(const std::vector<VerdictRow>& rows, std::size_t size) {
  std::vector<std::pair<std::string, const VerdictRow*>> order;
  for (const VerdictRow& row : rows) order.emplace_back(manifests::sha256(row.id), &row);
  std::sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<VerdictRow> chosen;
  for (std::size_t i = 0; i < std::min(size, order.size()); ++i) chosen.push_back(*order[i].second);
  return chosen;
}

}  // namespace

std::vector<GalleryPlan> plan_galleries(const dataset::PublishedDataset& dataset,
                                        const std::vector<VerdictRow>& rows, std::size_t size) {
  const ThresholdsByDataset& thresholds = dataset.manifest().thresholds;
  const auto kept = [](const VerdictRow& row, double value) {
    return row.label ? value : std::numeric_limits<double>::quiet_NaN();
  };
  // Returns |number - the threshold of its dataset| if the candidate was judged.
  const auto to_threshold = [&](double filters::Thresholds::*threshold, auto number) {
    return [&thresholds, threshold, number](const VerdictRow& row) {
      const auto found = thresholds.find(row.dataset);
      if (found == thresholds.end() || !row.is_judged()) return std::numeric_limits<double>::quiet_NaN();
      return std::abs(number(row.judgement) - found->second.*threshold);
    };
  };
  const auto error = [](const manifests::Judgement& judgement) { return judgement.initial_error; };
  const auto gain = [](const manifests::Judgement& judgement) { return judgement.gain; };
  return {{"Worst labels", "kept, with the largest L_proj",
           nearest(rows, size, [&](const VerdictRow& row) { return -kept(row, row.judgement.final_error); })},
          {"Best labels", "kept, with the smallest L_proj",
           nearest(rows, size, [&](const VerdictRow& row) { return kept(row, row.judgement.final_error); })},
          {"Nearest to tau_low", "retained or adapted by a hair",
           nearest(rows, size, to_threshold(&filters::Thresholds::tau_low, error))},
          {"Nearest to tau_high", "adapted or discarded by a hair",
           nearest(rows, size, to_threshold(&filters::Thresholds::tau_high, error))},
          {"Nearest to delta", "adaptation gained just enough, or just too little",
           nearest(rows, size, to_threshold(&filters::Thresholds::delta, gain))},
          {"By chance", "any candidates", by_chance(rows, size)}};
}

ordered_json draw_galleries(const dataset::PublishedDataset& dataset, const SourceFiles& files,
                            const OverlayPainter& painter, const std::vector<GalleryPlan>& plans) {
  ordered_json galleries = ordered_json::array();
  for (const GalleryPlan& plan : plans) {
    if (plan.rows.empty()) continue;
    ordered_json cards = ordered_json::array();
    for (const OverlaySubject& subject : read_subjects(dataset, files, plan.rows)) {
      run::throw_if_interrupted();
      const cv::Mat picture = painter.row(subject, kAllPanels, kTilePx);
      cards.push_back({{"id", subject.row.id},
                       {"line", verdict_line(subject.row)},
                       {"why", subject.why},
                       {"story", dataset::tell(dataset::explain(dataset.folder(), subject.row.id))},
                       {"width", picture.cols},
                       {"height", picture.rows},
                       {"picture", data_uri(picture)}});
    }
    ordered_json panels = ordered_json::array();
    for (const Panel panel : kAllPanels) panels.push_back(to_string(panel));
    galleries.push_back({{"title", plan.title},
                         {"meaning", plan.meaning},
                         {"open", galleries.size() < kOpenGalleries},
                         {"panels", std::move(panels)},
                         {"cards", std::move(cards)}});
  }
  return galleries;
}

}  // namespace q3d::pipeline::report
