#include "pipeline/evaluation/labels.h"

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <map>
#include <stdexcept>

#include "manifests/digest.h"
#include "manifests/lock.h"
#include "pipeline/build/workspace.h"
#include "pipeline/candidates/body_check.h"
#include "pipeline/candidates/configured_dataset.h"
#include "pipeline/evaluation/hidden_truth.h"
#include "pipeline/network/torch_bodies.h"
#include "pipeline/run/interrupt.h"
#include "pipeline/run/progress.h"
#include "pipeline/unit/crop_keypoints.h"
#include "pipeline/unit/decode.h"

namespace q3d::pipeline::evaluation {
namespace {

using manifests::Reason;
using manifests::Verdict;

constexpr std::size_t kChunk = 64;  // candidates whose meshes are in memory together

// The pool's records, completed by the truth files. They have the true keypoints if a file has them.
struct Truths {
  std::vector<manifests::SampleRecord> records;
  std::vector<std::optional<manifests::Keypoints>> keypoints;
};

// Returns whether the measurement needs facts that only the annotation files have.
bool needs_annotations(const JudgedPool& pool, const Truths& truths) {
  for (std::size_t i = 0; i < truths.records.size(); ++i) {
    const manifests::SampleRecord& record = truths.records[i];
    if (!record.truth || (pool.candidates[i].has_mask && record.mask_path.empty())) return true;
  }
  return false;
}

// Fills in bodies and masks from the annotation files where the truth files have none.
void add_annotated(const config::BuildConfig& config, std::vector<manifests::SampleRecord>& records) {
  std::map<std::string, manifests::SampleRecord> annotated;  // by id
  for (const config::DatasetConfig& options : config.datasets) {
    if (options.role != config::Role::pseudo) continue;
    run::throw_if_interrupted();
    std::vector<manifests::SampleRecord> loaded = candidates::load_configured(options).records;
    if (!options.body_model.empty()) {
      candidates::check_bodies(*network::load_body_meshes(options.body_model), options.keypoints_3d_of_body,
                               loaded);
    }
    for (manifests::SampleRecord& record : loaded) {
      const std::string id = record.id;
      annotated.emplace(id, std::move(record));
    }
  }
  for (manifests::SampleRecord& record : records) {
    const auto found = annotated.find(record.id);
    if (found == annotated.end()) {
      throw std::runtime_error(fmt::format(
          "{} is in the dataset and not in its annotation file any more; `build` with the same config again",
          record.id));
    }
    if (!record.truth) record.truth = found->second.truth;
    if (record.mask_path.empty()) record.mask_path = found->second.mask_path;
  }
}

Truths read_truths(const JudgedPool& pool, const config::BuildConfig& config, const LabelOptions& options,
                   LabelEvaluation& evaluation) {
  Truths truths;
  for (const JudgedCandidate& candidate : pool.candidates) truths.records.push_back(candidate.record);
  truths.keypoints.resize(truths.records.size());
  for (const auto& file : options.truth) {
    run::throw_if_interrupted();
    const HiddenTruth truth(file, options.masks);
    truth.complete(truths.records);
    for (std::size_t i = 0; i < truths.records.size(); ++i) {
      if (const PictureTruth* found = truth.find(truths.records[i].image_ref))
        truths.keypoints[i] = found->keypoints;
    }
    evaluation.truth_sha256.push_back(manifests::sha256_file(file));
  }
  if (needs_annotations(pool, truths)) add_annotated(config, truths.records);
  return truths;
}

class LabelMeasurer {
 public:
  LabelMeasurer(const JudgedPool& pool, const Truths& truths, const device::BodyMeshes& meshes)
      : pool_(pool), truths_(truths), meshes_(meshes) {}

  // Measures the candidates [first, first + count).
  std::vector<MeasuredCandidate> measure_some(std::size_t first, std::size_t count) {
    std::vector<double> mask_areas(count, 0.0);
    tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
      if (run::interrupted()) return;
      const manifests::SampleRecord& record = truths_.records[first + i];
      const JudgedCandidate& candidate = pool_.candidates[first + i];
      mask_areas[i] = unit::mask_area_px(record.mask_path, record.box, candidate.image_width_px,
                                         candidate.image_height_px);
    });
    run::throw_if_interrupted();
    std::vector<Target> targets;
    std::vector<const manifests::SampleRecord*> records;
    for (std::size_t i = 0; i < count; ++i) {
      records.push_back(&truths_.records[first + i]);
      targets.push_back(make_target(*records[i], mask_areas[i]));
    }
    add_true_meshes(records, meshes_, targets);
    std::vector<MeasuredCandidate> measured;
    for (std::size_t i = 0; i < count; ++i) measured.push_back(measure_one(first + i, targets[i]));
    return measured;
  }

 private:
  MeasuredCandidate measure_one(std::size_t index, const Target& target) const {
    const JudgedCandidate& candidate = pool_.candidates[index];
    MeasuredCandidate measured;
    measured.id = candidate.record.id;
    measured.verdict = candidate.verdict;
    measured.reason = candidate.reason;
    measured.normalised_by_mask = target.normalised_by_mask;
    measured.has_truth = target.keypoints_3d.has_value();
    std::optional<Target> projected;
    if (truths_.keypoints[index]) {
      manifests::SampleRecord record = candidate.record;
      record.keypoints = *truths_.keypoints[index];
      projected.emplace();
      projected->keypoints = unit::crop_keypoints(record);
      projected->normaliser_px = target.normaliser_px;
    }
    measured.predicted = measure_body(candidate.predicted, target, projected);
    if (candidate.refined) {
      measured.label = measure_body(*candidate.refined, target, projected);
    } else if (candidate.label() != nullptr) {
      measured.label = measured.predicted;
    }
    return measured;
  }

  MeasuredBody measure_body(const device::BodyPrediction& body, const Target& target,
                            const std::optional<Target>& projected) const {
    MeasuredBody measured;
    std::vector<device::BodyMesh> mesh;
    if (!target.vertices.empty()) {
      const smal::Body& posed = body;
      mesh = meshes_.pose(std::span(&posed, 1));
    }
    measured.annotated = measure(body, mesh.empty() ? nullptr : &mesh.front(), target);
    if (projected) measured.projected = measure(body, nullptr, *projected);
    return measured;
  }

  const JudgedPool& pool_;
  const Truths& truths_;
  const device::BodyMeshes& meshes_;
};

bool is_kept(const MeasuredCandidate& candidate) {
  return candidate.label.has_value();
}

struct Group {
  std::string name;
  bool by_label = false;
  bool (*holds)(const MeasuredCandidate&) = nullptr;
};

const std::vector<Group>& groups() {
  static const auto kRefined = [](const MeasuredCandidate& c) { return c.verdict == Verdict::refined; };
  static const std::vector<Group> kGroups{
      {"pool", false, [](const MeasuredCandidate&) { return true; }},
      {"kept", true, is_kept},
      {"kept", false, is_kept},
      {"retained", true, [](const MeasuredCandidate& c) { return c.verdict == Verdict::retained; }},
      {"refined", true, kRefined},
      {"refined", false, kRefined},
      {"discarded", false, [](const MeasuredCandidate& c) { return c.verdict == Verdict::discarded; }},
  };
  return kGroups;
}

LabelRow make_row(const std::string& group, bool by_label,
                  const std::vector<const MeasuredCandidate*>& some) {
  LabelRow row;
  row.group = group;
  row.bodies = by_label ? "label" : "prediction";
  row.samples = static_cast<std::int64_t>(some.size());
  std::vector<const MetricValues*> annotated, projected;
  for (const MeasuredCandidate* candidate : some) {
    const MeasuredBody& body = by_label ? *candidate->label : candidate->predicted;
    annotated.push_back(&body.annotated);
    projected.push_back(&body.projected);
    row.by_mask += candidate->normalised_by_mask ? 1 : 0;
  }
  for (std::size_t m = 0; m < kMetricCount; ++m) {
    row.annotated[m] = mean_of(annotated, m);
    row.projected[m] = mean_of(projected, m);
  }
  return row;
}

}  // namespace

std::vector<LabelRow> group_labels(const std::vector<MeasuredCandidate>& candidates) {
  std::vector<LabelRow> rows;
  for (const Group& group : groups()) {
    std::vector<const MeasuredCandidate*> some;
    for (const MeasuredCandidate& candidate : candidates) {
      if (group.holds(candidate)) some.push_back(&candidate);
    }
    if (!some.empty()) rows.push_back(make_row(group.name, group.by_label, some));
  }
  std::map<std::string, std::vector<const MeasuredCandidate*>> reasons;
  for (const MeasuredCandidate& candidate : candidates) {
    if (candidate.verdict != Verdict::discarded) continue;
    reasons["discarded: " + std::string(manifests::to_string(candidate.reason))].push_back(&candidate);
  }
  for (const auto& [reason, some] : reasons) rows.push_back(make_row(reason, false, some));
  return rows;
}

LabelEvaluation evaluate_labels(const config::BuildConfig& config, const LabelOptions& options) {
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    build::flow_threads(options.run.threads));
  const manifests::FolderLock lock(options.run.out);
  const JudgedPool pool = read_judged_pool(config, options.run.out);
  LabelEvaluation evaluation;
  evaluation.dataset = pool.dataset;
  evaluation.content_id = pool.content_id;
  evaluation.failed = pool.failed;
  const Truths truths = read_truths(pool, config, options, evaluation);
  const std::unique_ptr<device::BodyMeshes> meshes = network::load_body_meshes(config.network.smal_asset);
  LabelMeasurer measurer(pool, truths, *meshes);
  run::Progress progress("measured", static_cast<std::int64_t>(pool.candidates.size()), options.run.quiet);
  for (std::size_t first = 0; first < pool.candidates.size(); first += kChunk) {
    const std::size_t count = std::min(kChunk, pool.candidates.size() - first);
    for (MeasuredCandidate& measured : measurer.measure_some(first, count)) {
      evaluation.without_truth += measured.has_truth ? 0 : 1;
      evaluation.candidates.push_back(std::move(measured));
    }
    progress.advance(static_cast<std::int64_t>(count));
  }
  if (!evaluation.candidates.empty() &&
      evaluation.without_truth == static_cast<std::int64_t>(evaluation.candidates.size())) {
    throw std::runtime_error("no candidate of the pool has a truth; give the pool's own file with --truth");
  }
  evaluation.rows = group_labels(evaluation.candidates);
  return evaluation;
}

}  // namespace q3d::pipeline::evaluation
