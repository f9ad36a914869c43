#include "pipeline/dataset/explain.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cmath>
#include <optional>
#include <stdexcept>

#include "loaders/keypoints/topology.h"
#include "loaders/pictures/crop.h"
#include "pipeline/dataset/published_dataset.h"
#include "pipeline/dataset/sentences.h"
#include "pipeline/unit/crop_keypoints.h"

namespace q3d::pipeline::dataset {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

// Everything that is known about the candidate in addition to its row of verdicts.csv.
struct Evidence {
  manifests::SampleRecord record;  // id, image_ref, box and keypoints
  std::optional<smal::CropPoints> before;
  std::optional<smal::CropPoints> after;
  std::vector<double> curve;
  std::vector<double> held_out_curve;
  std::vector<std::string> missing;
};

ordered_json number_or_null(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

// Reads the candidate's rows in the stages' tables. Leaves the evidence without an id if there are none.
void read_stages(const PublishedDataset& dataset, const VerdictRow& row, Evidence& evidence) {
  const std::int64_t unit = dataset.unit_of(row);
  const std::size_t place = dataset.place_in_unit(row);
  const auto predicted = dataset.predictions(unit);
  if (!predicted || place >= predicted->candidates.size() || predicted->candidates[place].id != row.id) {
    evidence.missing.emplace_back(
        "predictions: the stage's folder is gone, or was made anew for other candidates");
    return;
  }
  evidence.record = predicted->candidates[place];
  const unit::PredictedSample& sample = predicted->samples[place];
  if (sample.failure == manifests::Reason::none) evidence.before = sample.body.keypoints_2d;
  if (auto refined = dataset.refinements(unit)) {
    for (unit::RefinedSample& each : *refined) {
      if (each.sample != place) continue;
      evidence.curve = std::move(each.curve);
      evidence.held_out_curve = std::move(each.held_out_curve);
      evidence.after = each.body.keypoints_2d;
    }
  }
}

// Gathers the evidence. A damaged table is reported, not thrown, because the other parts are still valid.
Evidence gather(const PublishedDataset& dataset, const VerdictRow& row) {
  Evidence evidence;
  try {
    read_stages(dataset, row, evidence);
  } catch (const std::runtime_error& error) {
    evidence.missing.emplace_back(error.what());
  }
  if (!evidence.record.id.empty() || !row.label) return evidence;
  // A kept sample's label is in its shard, even if the dataset was moved.
  const manifests::ShardSample sample = dataset.sample(row);
  evidence.record = sample.record;
  if (sample.has_keypoints_3d) evidence.after = sample.projected_2d;
  return evidence;
}

// (|dx| + |dy|) / 2: the mean of these over the visible keypoints is L_proj.
ordered_json keypoint_error(const std::optional<smal::CropPoints>& projected,
                            const device::CropKeypoints& annotated, std::size_t k) {
  if (!projected || !annotated[k].is_visible()) return nullptr;
  const double dx = double{(*projected)[k].x} - annotated[k].x;
  const double dy = double{(*projected)[k].y} - annotated[k].y;
  return number_or_null((std::abs(dx) + std::abs(dy)) / 2.0);
}

ordered_json describe_keypoints(const Evidence& evidence) {
  const std::vector<std::string>& names = loaders::keypoints::topology("animal3d26").keypoints;
  const device::CropKeypoints annotated = unit::crop_keypoints(evidence.record);
  ordered_json list = ordered_json::array();
  for (std::size_t k = 0; k < names.size(); ++k) {
    const manifests::Keypoint& point = evidence.record.keypoints[k];
    list.push_back({{"name", names[k]},
                    {"v", number_or_null(point.v)},
                    {"weight", point.weight},
                    {"annotated_px", {point.x_px, point.y_px}},
                    {"error_before", keypoint_error(evidence.before, annotated, k)},
                    {"error_after", keypoint_error(evidence.after, annotated, k)}});
  }
  return list;
}

ordered_json describe_crop(const manifests::SampleRecord& record) {
  const loaders::pictures::SquareBox square = loaders::pictures::square_box(record.box);
  return {{"box_xywh_px", {record.box.x_px, record.box.y_px, record.box.w_px, record.box.h_px}},
          {"center_px", {square.center_x_px, square.center_y_px}},
          {"side_px", square.side_px},
          {"patch_side_px", loaders::pictures::kPatchSidePx},
          {"patch_from_image", loaders::pictures::patch_from_image(square, loaders::pictures::kPatchSidePx)}};
}

// Describes the trust scores. Returns null if nothing was measured.
ordered_json describe_trust(const manifests::TrustScores& trust) {
  ordered_json scores = ordered_json::object();
  for (const manifests::TrustColumn& column : manifests::kTrustColumns) {
    scores[column.name] = number_or_null(trust.*column.score);
  }
  return scores;
}

ordered_json describe_verdict(const VerdictRow& row) {
  const manifests::Judgement& judgement = row.judgement;
  const auto if_judged = [&](int count) {
    return row.is_judged() ? ordered_json(count) : ordered_json(nullptr);
  };
  return {{"verdict", manifests::to_string(judgement.verdict)},
          {"reason", manifests::to_string(judgement.reason)},
          {"detail", judgement.detail},
          {"initial_error", number_or_null(judgement.initial_error)},
          {"final_error", number_or_null(judgement.final_error)},
          {"gain", number_or_null(judgement.gain)},
          {"iterations", if_judged(judgement.iterations)},
          {"best_iteration", if_judged(judgement.best_iteration)}};
}

ordered_json describe_source(const VerdictRow& row, const Evidence& evidence) {
  return {{"dataset", row.dataset},
          {"split", row.split},
          {"source", row.source},
          {"species", row.species},
          {"family", manifests::to_string(row.family)},
          {"picture", evidence.record.image_ref},
          {"image_sha256", row.image_sha256}};
}

// Returns the thresholds of the candidate's dataset, or nothing if its labels are not predictions.
std::optional<filters::Thresholds> thresholds_of(const DatasetManifest& manifest, const std::string& name) {
  const auto found = manifest.thresholds.find(name);
  return found == manifest.thresholds.end() ? std::nullopt : std::optional(found->second);
}

ordered_json describe_thresholds(const std::optional<filters::Thresholds>& thresholds) {
  if (!thresholds) return nullptr;
  return {{"tau_low", thresholds->tau_low}, {"tau_high", thresholds->tau_high}, {"delta", thresholds->delta}};
}

void add_evidence(const Evidence& evidence, ordered_json& story) {
  if (!evidence.record.id.empty() && evidence.record.box.w_px > 0) {
    story["crop"] = describe_crop(evidence.record);
    story["keypoints"] = describe_keypoints(evidence);
  }
  if (!evidence.curve.empty()) {
    story["curve"] = ordered_json::array();
    for (const double error : evidence.curve) story["curve"].push_back(number_or_null(error));
  }
  if (!evidence.held_out_curve.empty()) story["held_out_curve"] = evidence.held_out_curve;
}

}  // namespace

ordered_json explain(const fs::path& given, const std::string& id) {
  const PublishedDataset dataset(given);
  const VerdictRow row = dataset.verdict(id);
  const Evidence evidence = gather(dataset, row);
  const auto thresholds = thresholds_of(dataset.manifest(), row.dataset);
  ordered_json story = {{"id", row.id}, {"dataset", dataset.version_name()}};
  story["verdict"] = describe_verdict(row);
  story["thresholds"] = describe_thresholds(thresholds);
  story["why"] = why(row.judgement, dataset.role(row), thresholds);
  if (!std::isnan(row.judgement.trust.visible)) story["trust"] = describe_trust(row.judgement.trust);
  story["source"] = describe_source(row, evidence);
  add_evidence(evidence, story);
  if (const auto kind = dataset.label_kind(row)) {
    story["label"] = {{"shard", dataset.shard_of_unit(row.label->shard).file},
                      {"row", row.label->row},
                      {"kind", manifests::to_string(*kind)},
                      {"meaning", sentence(*kind)}};
  }
  if (!evidence.missing.empty()) story["missing"] = evidence.missing;
  return story;
}

}  // namespace q3d::pipeline::dataset
