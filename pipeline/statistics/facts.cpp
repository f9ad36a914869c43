#include "pipeline/statistics/facts.h"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <optional>
#include <span>
#include <stdexcept>

#include "filters/metrics.h"
#include "manifests/enumerators.h"
#include "pipeline/run/interrupt.h"
#include "pipeline/unit/annotated_body.h"
#include "pipeline/unit/crop_keypoints.h"

namespace q3d::pipeline::statistics {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// Returns nothing if the body has no projection or no keypoint is visible.
std::optional<Fit> fit_of(const smal::CropPoints& projected, const smal::CropKeypoints& annotated) {
  if (!unit::has_projection(projected)) return std::nullopt;
  const auto area = filters::auc(projected, annotated, smal::kCropSidePx);
  if (!area) return std::nullopt;
  Fit fit;
  fit.auc = *area;
  for (std::size_t k = 0; k < fit.distance.size(); ++k) {
    fit.distance[k] = annotated[k].is_visible()
                          ? std::hypot(projected[k].x - annotated[k].x, projected[k].y - annotated[k].y)
                          : kNaN;
  }
  return fit;
}

void set_geometry(CandidateFacts& facts, const manifests::SampleRecord& record) {
  facts.has_geometry = record.box.w_px > 0.0 && record.box.h_px > 0.0;
  facts.visible = unit::visible_keypoints(unit::crop_keypoints(record));
  facts.box_w_px = record.box.w_px;
  facts.box_h_px = record.box.h_px;
}

class Gatherer {
 public:
  explicit Gatherer(const dataset::PublishedDataset& dataset) : dataset_(dataset) {}

  Facts gather() {
    Facts facts;
    for (dataset::VerdictRow& row : dataset_.verdicts()) {
      CandidateFacts& candidate = facts.candidates.emplace_back();
      candidate.role = dataset_.role(row);
      candidate.row = std::move(row);
    }
    const std::size_t size = dataset_.manifest().unit_size;
    for (std::size_t first = 0; first < facts.candidates.size(); first += size) {
      run::throw_if_interrupted();
      const std::size_t count = std::min(size, facts.candidates.size() - first);
      const auto unit = static_cast<std::int64_t>(first / size);
      const std::span<CandidateFacts> candidates = std::span(facts.candidates).subspan(first, count);
      if (!read_tables(unit, candidates)) {
        ++units_without_tables_;
        read_shards(candidates);
      }
    }
    if (units_without_tables_ > 0) {
      facts.missing.push_back(
          fmt::format("The stages' tables of {} units are gone or were made anew for other candidates. Of "
                      "their candidates, only those that were kept have keypoints and errors here.",
                      units_without_tables_));
    }
    return facts;
  }

 private:
  bool read_tables(std::int64_t unit, std::span<CandidateFacts> candidates) {
    const auto predictions = dataset_.predictions(unit);
    if (!predictions || predictions->candidates.size() != candidates.size()) return false;
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      if (predictions->candidates[i].id != candidates[i].row.id) return false;
    }
    std::map<std::size_t, device::BodyPrediction> adapted;
    if (const auto refined = dataset_.refinements(unit)) {
      for (const unit::RefinedSample& sample : *refined) adapted[sample.sample] = sample.body;
    }
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      const auto body = adapted.find(i);
      set(candidates[i], predictions->candidates[i], predictions->samples[i],
          body == adapted.end() ? nullptr : &body->second);
    }
    return true;
  }

  static void set(CandidateFacts& facts, const manifests::SampleRecord& record,
                  const unit::PredictedSample& predicted, const device::BodyPrediction* adapted) {
    set_geometry(facts, record);
    facts.image_w_px = predicted.image_width_px;
    facts.image_h_px = predicted.image_height_px;
    if (predicted.failure != manifests::Reason::none) return;
    const smal::CropKeypoints annotated = unit::crop_keypoints(record);
    if (facts.role == config::Role::pseudo) facts.prediction = fit_of(predicted.body.keypoints_2d, annotated);
    if (!facts.row.label || facts.role == config::Role::two_d_only) return;
    const bool is_refined = facts.row.judgement.verdict == manifests::Verdict::refined;
    if (is_refined && adapted == nullptr) return;
    const device::BodyPrediction& label = is_refined ? *adapted : predicted.body;
    facts.label = fit_of(label.keypoints_2d, annotated);
    facts.betas = label.betas;
  }

  // Reads labels from the shards, at the places that the verdicts state. In a version that was made from
  // others, the candidates of a shard are not those of the unit with its number.
  void read_shards(std::span<CandidateFacts> candidates) {
    std::optional<manifests::ShardReader> shard;  // opened when one of its rows is needed
    std::int64_t opened = 0;
    for (CandidateFacts& facts : candidates) {
      if (!facts.row.label) continue;
      if (!shard || opened != facts.row.label->shard) {
        opened = facts.row.label->shard;
        shard.emplace(dataset_.open_shard(dataset_.shard_of_unit(opened)));
      }
      const manifests::ShardSample sample = shard->samples(facts.row.label->row, 1).front();
      if (sample.record.id != facts.row.id) {
        throw std::runtime_error(fmt::format("{}: row {} is {}, not {}, as verdicts.csv says; run `verify`",
                                             dataset_.shard_file(dataset_.shard_of_unit(opened)).string(),
                                             facts.row.label->row, sample.record.id, facts.row.id));
      }
      set_geometry(facts, sample.record);
      facts.image_w_px = sample.image_width_px;
      facts.image_h_px = sample.image_height_px;
      if (sample.has_keypoints_3d) {
        facts.label = fit_of(sample.projected_2d, unit::crop_keypoints(sample.record));
      }
      if (sample.has_betas) facts.betas = sample.body.betas;
    }
  }

  const dataset::PublishedDataset& dataset_;
  std::int64_t units_without_tables_ = 0;
};

}  // namespace

Facts gather(const dataset::PublishedDataset& dataset) {
  return Gatherer(dataset).gather();
}

}  // namespace q3d::pipeline::statistics
