#include "pipeline/derived/difference.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <span>
#include <unordered_map>

#include "pipeline/dataset/published_dataset.h"
#include "pipeline/run/interrupt.h"

namespace q3d::pipeline::derived {
namespace {

namespace fs = std::filesystem;
using dataset::PublishedDataset;
using dataset::VerdictRow;
using manifests::ShardSample;
using nlohmann::ordered_json;

constexpr std::size_t kShownLines = 10;  // lines of each list on the page

double distance(std::span<const float> a, std::span<const float> b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += std::pow(double{a[i]} - double{b[i]}, 2);
  return std::sqrt(sum);
}

// Returns the mean angle between the joints' rotations in two poses.
double mean_angle_deg(const smal::Pose& a, const smal::Pose& b) {
  double sum = 0.0;
  for (std::size_t joint = 0; joint < manifests::kNumJoints; ++joint) {
    double trace = 0.0;  // of A^T B
    for (std::size_t i = 0; i < 9; ++i) trace += double{a[9 * joint + i]} * double{b[9 * joint + i]};
    sum += std::acos(std::clamp((trace - 1.0) / 2.0, -1.0, 1.0));
  }
  return sum / manifests::kNumJoints * 180.0 / std::numbers::pi;
}

double mean_keypoint_distance_mm(const smal::Keypoints3d& a, const smal::Keypoints3d& b) {
  double sum = 0.0;
  for (std::size_t k = 0; k < a.size(); k += 3) {
    sum += distance(std::span(a).subspan(k, 3), std::span(b).subspan(k, 3));
  }
  return 1000.0 * sum / manifests::kNumKeypoints;
}

bool is_equal(const ShardSample& a, const ShardSample& b) {
  return a.label_kind == b.label_kind && a.has_pose == b.has_pose && a.has_betas == b.has_betas &&
         a.has_keypoints_3d == b.has_keypoints_3d && a.body.pose == b.body.pose &&
         a.body.betas == b.body.betas && a.body.translation == b.body.translation &&
         a.keypoints_3d == b.keypoints_3d;
}

LabelChange change_of(const ShardSample& a, const ShardSample& b) {
  return {a.record.id,
          a.judgement.final_error,
          b.judgement.final_error,
          mean_angle_deg(a.body.pose, b.body.pose),
          distance(a.body.betas, b.body.betas),
          mean_keypoint_distance_mm(a.keypoints_3d, b.keypoints_3d),
          1000.0 * distance(a.body.translation, b.body.translation)};
}

// Reads samples shard after shard, so that each shard is opened once.
class Samples {
 public:
  explicit Samples(const PublishedDataset& dataset) : dataset_(dataset) {}
  ShardSample at(const VerdictRow& row) {
    const std::int64_t unit = row.label.value().shard;
    auto found = shards_.find(unit);
    if (found == shards_.end()) {
      found = shards_.emplace(unit, dataset_.open_shard(dataset_.shard_of_unit(unit))).first;
    }
    return std::move(found->second.samples(row.label->row, 1).front());
  }

 private:
  const PublishedDataset& dataset_;
  std::map<std::int64_t, manifests::ShardReader> shards_;
};

void list(std::string& text, const std::string& title, const std::vector<std::string>& lines) {
  if (lines.empty()) return;
  text += fmt::format("{}: {}\n", title, lines.size());
  for (std::size_t i = 0; i < std::min(kShownLines, lines.size()); ++i) text += "  " + lines[i] + "\n";
  if (lines.size() > kShownLines) text += fmt::format("  and {} more (--json)\n", lines.size() - kShownLines);
}

}  // namespace

VersionDifference compare_versions(const fs::path& before_folder, const fs::path& after_folder) {
  const PublishedDataset before(before_folder);
  const PublishedDataset after(after_folder);
  VersionDifference result;
  result.before = before.version_name();
  result.after = after.version_name();
  std::unordered_map<std::string, VerdictRow> rows_after;
  for (const VerdictRow& row : after.verdicts()) rows_after.emplace(row.id, row);
  Samples samples_before(before);
  Samples samples_after(after);
  for (const VerdictRow& row : before.verdicts()) {
    run::throw_if_interrupted();
    const auto found = rows_after.find(row.id);
    if (found == rows_after.end()) {
      result.only_before.push_back(row.id);
      continue;
    }
    const VerdictRow other = std::move(found->second);
    rows_after.erase(found);
    ++result.in_both;
    if (row.judgement.verdict != other.judgement.verdict) {
      result.verdicts[{row.judgement.verdict, other.judgement.verdict}].push_back(row.id);
    }
    if (!row.label || !other.label) continue;
    const ShardSample a = samples_before.at(row);
    const ShardSample b = samples_after.at(other);
    if (is_equal(a, b)) {
      ++result.equal_labels;
    } else {
      result.labels.push_back(change_of(a, b));
    }
  }
  for (const auto& [id, row] : rows_after) result.only_after.push_back(id);
  std::sort(result.only_after.begin(), result.only_after.end());
  std::stable_sort(result.labels.begin(), result.labels.end(),
                   [](const auto& a, const auto& b) { return a.keypoints_3d_mm > b.keypoints_3d_mm; });
  return result;
}

ordered_json to_json(const VersionDifference& difference) {
  const auto number = [](double value) {
    return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
  };
  ordered_json verdicts = ordered_json::array();
  for (const auto& [change, ids] : difference.verdicts) {
    verdicts.push_back({{"before", manifests::to_string(change.first)},
                        {"after", manifests::to_string(change.second)},
                        {"ids", ids}});
  }
  ordered_json labels = ordered_json::array();
  for (const LabelChange& change : difference.labels) {
    labels.push_back({{"id", change.id},
                      {"error_before", number(change.error_before)},
                      {"error_after", number(change.error_after)},
                      {"rotation_deg", number(change.rotation_deg)},
                      {"betas", number(change.betas)},
                      {"keypoints_3d_mm", number(change.keypoints_3d_mm)},
                      {"translation_mm", number(change.translation_mm)}});
  }
  return {{"before", difference.before},
          {"after", difference.after},
          {"in_both", difference.in_both},
          {"only_before", difference.only_before},
          {"only_after", difference.only_after},
          {"verdicts", verdicts},
          {"equal_labels", difference.equal_labels},
          {"labels", labels}};
}

std::string page_of(const VersionDifference& difference) {
  std::string text = fmt::format("{} -> {}\n{} candidates are in both\n", difference.before, difference.after,
                                 difference.in_both);
  list(text, "only in the first", difference.only_before);
  list(text, "only in the second", difference.only_after);
  for (const auto& [change, ids] : difference.verdicts) {
    list(text,
         fmt::format("{} -> {}", manifests::to_string(change.first), manifests::to_string(change.second)),
         ids);
  }
  text += fmt::format("labels of both: {} equal, {} changed\n", difference.equal_labels,
                      difference.labels.size());
  if (difference.labels.empty()) return text;
  text += "  L_proj            rotations   3D keypoints\n";
  for (std::size_t i = 0; i < std::min(kShownLines, difference.labels.size()); ++i) {
    const LabelChange& change = difference.labels[i];
    text += fmt::format("  {:.4f} -> {:.4f}  {:6.1f} deg  {:9.1f} mm  {}\n", change.error_before,
                        change.error_after, change.rotation_deg, change.keypoints_3d_mm, change.id);
  }
  if (difference.labels.size() > kShownLines) {
    text += fmt::format("  and {} more (--json)\n", difference.labels.size() - kShownLines);
  }
  return text;
}

}  // namespace q3d::pipeline::derived
