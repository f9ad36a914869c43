#include "pipeline/evaluation/dataset_evaluator.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <memory>

#include "pipeline/run/interrupt.h"
#include "pipeline/unit/decode.h"
#include "pipeline/unit/unit_flow.h"

namespace q3d::pipeline::evaluation {
namespace {

using manifests::Reason;

constexpr std::size_t kUnitSize = 64;  // batches form inside a unit, so this affects the results' last bits

std::vector<candidates::Unit> cut_units(std::size_t candidates) {
  std::vector<candidates::Unit> units;
  for (std::size_t first = 0; first < candidates; first += kUnitSize) {
    candidates::Unit unit;
    unit.index = static_cast<std::int64_t>(units.size());
    unit.first = first;
    unit.count = std::min(kUnitSize, candidates - first);
    units.push_back(unit);
  }
  return units;
}

// The samples of a unit that have a picture and a finite prediction.
struct Measurable {
  std::vector<std::size_t> samples;  // indices into the results
  std::vector<device::PatchView> patches;
  std::vector<device::BodyPrediction> bodies;
  std::vector<Target> targets;
};

class RecordEvaluator {
 public:
  RecordEvaluator(std::vector<manifests::SampleRecord> records, const Instruments& instruments,
                  run::Progress& progress)
      : instruments_(instruments), progress_(progress), results_(records.size()) {
    for (std::size_t i = 0; i < records.size(); ++i) {
      SampleResult& result = results_[i];
      result.id = records[i].id;
      result.species = records[i].species;
      result.family = records[i].family;
      if (records[i].truth && records[i].truth->has_betas) result.true_betas = records[i].truth->betas;
      if (records[i].failure == Reason::no_visible_keypoints) records[i].failure = Reason::none;
      result.failure = records[i].failure;
      result.detail = records[i].failure_detail;
      candidates_.emplace_back().record = std::move(records[i]);
    }
    units_ = cut_units(candidates_.size());
  }

  std::vector<SampleResult> run() {
    unit::UnitFlow flow;
    flow.units = static_cast<std::int64_t>(units_.size());
    flow.read = [this](std::int64_t index) {
      auto work = std::make_shared<unit::UnitWork>();
      work->unit = &units_[static_cast<std::size_t>(index)];
      work->candidates = std::span(candidates_).subspan(work->unit->first, work->unit->count);
      return work;
    };
    flow.decode = [](unit::UnitWork& work) { decode(work); };
    flow.compute = [this](unit::UnitWork& work) { compute(work); };
    flow.write = [this](unit::UnitWork& work) {
      progress_.advance(static_cast<std::int64_t>(work.unit->count));
    };
    unit::run_units(flow, *instruments_.device);
    return std::move(results_);
  }

 private:
  static void decode(unit::UnitWork& work) {
    work.decoded.assign(work.candidates.size(), {});
    tbb::parallel_for(std::size_t{0}, work.candidates.size(), [&](std::size_t i) {
      const candidates::Candidate& candidate = work.candidates[i];
      if (run::interrupted() || candidate.record.failure != Reason::none) return;
      work.decoded[i] =
          unit::decode_sample(candidate, {.patch = true, .stored_crop = false, .mask_area = true}, {});
    });
  }

  void compute(const unit::UnitWork& work) {
    Measurable unit = predict(work);
    measure_setting(0, unit.bodies, unit);
    std::size_t setting = 1;
    for (const TtaPass& pass : instruments_.plan->passes) setting = adapt(pass, setting, unit);
  }

  Measurable predict(const unit::UnitWork& work) {
    std::vector<device::PatchView> patches;
    std::vector<std::size_t> positions;
    for (std::size_t i = 0; i < work.candidates.size(); ++i) {
      const unit::DecodedSample& decoded = work.decoded[i];
      SampleResult& result = results_[work.unit->first + i];
      if (result.failure != Reason::none) continue;
      if (!decoded.detail.empty()) result.detail = decoded.detail;
      result.failure = decoded.failure;
      if (decoded.failure != Reason::none) continue;
      patches.emplace_back(decoded.patch);
      positions.push_back(i);
    }
    const std::vector<device::BodyPrediction> bodies = instruments_.network->predict(patches);
    Measurable unit;
    std::vector<const manifests::SampleRecord*> records;
    for (std::size_t j = 0; j < bodies.size(); ++j) {
      const std::size_t i = positions[j];
      SampleResult& result = results_[work.unit->first + i];
      if (!device::is_finite(bodies[j])) {
        result.failure = Reason::prediction_not_finite;
        result.detail = "the network's output holds NaN or infinity";
        continue;
      }
      const manifests::SampleRecord& record = work.candidates[i].record;
      unit.samples.push_back(work.unit->first + i);
      unit.patches.push_back(patches[j]);
      unit.bodies.push_back(bodies[j]);
      unit.targets.push_back(make_target(record, work.decoded[i].mask_area_px));
      records.push_back(&record);
      result.normalised_by_mask = unit.targets.back().normalised_by_mask;
      result.values.resize(instruments_.plan->settings.size());
      result.betas.resize(instruments_.plan->settings.size());
    }
    add_true_meshes(records, *instruments_.meshes, unit.targets);
    return unit;
  }

  // Measures the results of one pass. Returns the index after the pass's last setting.
  std::size_t adapt(const TtaPass& pass, std::size_t setting, const Measurable& unit) {
    run::throw_if_interrupted();
    std::vector<device::AdaptRequest> requests;
    for (std::size_t j = 0; j < unit.samples.size(); ++j) {
      device::AdaptRequest& request = requests.emplace_back();
      request.patch = unit.patches[j];
      request.keypoints = hide_keypoints(unit.targets[j].keypoints, pass.visible_share, instruments_.seed,
                                         results_[unit.samples[j]].id);
      request.schedule.iterations = pass.iterations;
    }
    const std::vector<device::AdaptOutcome> outcomes = instruments_.network->adapt(requests, pass.iterates);
    const auto measure_all = [&](auto&& body_of) {
      std::vector<device::BodyPrediction> bodies;
      for (const device::AdaptOutcome& outcome : outcomes) bodies.push_back(body_of(outcome));
      measure_setting(setting++, bodies, unit);
    };
    if (pass.iterates.empty()) measure_all([](const device::AdaptOutcome& outcome) { return outcome.best; });
    for (std::size_t i = 0; i < pass.iterates.size(); ++i) {
      measure_all([i](const device::AdaptOutcome& outcome) { return outcome.snapshots[i]; });
    }
    return setting;
  }

  void measure_setting(std::size_t setting, std::span<const device::BodyPrediction> bodies,
                       const Measurable& unit) {
    std::vector<smal::Body> posing;
    std::vector<std::size_t> with_mesh;
    for (std::size_t j = 0; j < bodies.size(); ++j) {
      if (unit.targets[j].vertices.empty()) continue;
      posing.push_back(bodies[j]);
      with_mesh.push_back(j);
    }
    const std::vector<device::BodyMesh> posed = instruments_.meshes->pose(posing);
    std::vector<const device::BodyMesh*> mesh_of(bodies.size(), nullptr);
    for (std::size_t m = 0; m < posed.size(); ++m) mesh_of[with_mesh[m]] = &posed[m];
    for (std::size_t j = 0; j < bodies.size(); ++j) {
      SampleResult& result = results_[unit.samples[j]];
      result.values[setting] = measure(bodies[j], mesh_of[j], unit.targets[j]);
      result.betas[setting] = bodies[j].betas;
    }
  }

  const Instruments& instruments_;
  run::Progress& progress_;
  std::vector<candidates::Candidate> candidates_;
  std::vector<candidates::Unit> units_;
  std::vector<SampleResult> results_;  // written on the device's thread only
};

}  // namespace

std::vector<SampleResult> evaluate_records(std::vector<manifests::SampleRecord> records,
                                           const Instruments& instruments, run::Progress& progress) {
  return RecordEvaluator(std::move(records), instruments, progress).run();
}

}  // namespace q3d::pipeline::evaluation
