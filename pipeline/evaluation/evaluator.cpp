#include "pipeline/evaluation/evaluator.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <utility>

#include "manifests/digest.h"
#include "manifests/record_json.h"
#include "pipeline/evaluation/result_table.h"
#include "pipeline/run/interrupt.h"
#include "pipeline/unit/decode.h"

namespace q3d::pipeline::evaluation {
namespace {

using manifests::Reason;

constexpr std::size_t kUnitSize = 64;  // batches form inside a unit, so this affects the results' last bits

// Returns a digest of everything that decides a unit's results, apart from network and settings.
std::string digest_of(std::span<const candidates::Candidate> candidates) {
  std::string text;
  for (const candidates::Candidate& candidate : candidates) {
    text += fmt::format("{} {} {} {} {}\n", manifests::record_digest(candidate.record),
                        candidate.image_sha256, candidate.mask_sha256, to_string(candidate.record.failure),
                        candidate.record.failure_detail);
  }
  return manifests::sha256(text);
}

SampleResult unmeasured(const manifests::SampleRecord& record) {
  SampleResult result;
  result.id = record.id;
  result.species = record.species;
  result.family = record.family;
  if (record.truth && record.truth->has_betas) result.true_betas = record.truth->betas;
  result.failure = record.failure;
  result.detail = record.failure_detail;
  return result;
}

}  // namespace

void append(std::vector<manifests::SampleRecord> records, manifests::DigestCache& digests, Pool& pool) {
  const std::size_t begin = pool.candidates.size();
  for (manifests::SampleRecord& record : records) {
    if (record.failure == Reason::no_visible_keypoints) record.failure = Reason::none;
    pool.candidates.emplace_back().record = std::move(record);
  }
  candidates::digest_pictures(std::span(pool.candidates).subspan(begin), digests);
  for (std::size_t first = begin; first < pool.candidates.size(); first += kUnitSize) {
    candidates::Unit& unit = pool.units.emplace_back();
    unit.index = static_cast<std::int64_t>(pool.units.size()) - 1;
    unit.first = first;
    unit.count = std::min(kUnitSize, pool.candidates.size() - first);
    unit.input_digest = digest_of(std::span(pool.candidates).subspan(unit.first, unit.count));
  }
}

// The samples of a unit that have a picture and a finite prediction.
struct Evaluator::Measurable {
  std::vector<std::size_t> samples;  // indices into the results
  std::vector<device::PatchView> patches;
  std::vector<device::BodyPrediction> bodies;
  std::vector<Target> targets;
};

Evaluator::Evaluator(const Pool& pool, const Instruments& instruments, stages::StageStore& store)
    : pool_(pool), instruments_(instruments), store_(store) {
  for (const candidates::Candidate& candidate : pool.candidates) {
    results_.push_back(unmeasured(candidate.record));
  }
}

unit::UnitFlow Evaluator::flow(run::Progress& progress) {
  unit::UnitFlow flow;
  flow.units = static_cast<std::int64_t>(pool_.units.size());
  flow.read = [this](std::int64_t index) {
    auto work = std::make_shared<unit::UnitWork>();
    work->unit = &pool_.units[static_cast<std::size_t>(index)];
    work->candidates = std::span(pool_.candidates).subspan(work->unit->first, work->unit->count);
    work->predicted_before = load(*work->unit);
    return work;
  };
  flow.decode = [](unit::UnitWork& work) {
    if (!work.predicted_before) decode(work);
  };
  flow.compute = [this](unit::UnitWork& work) {
    if (!work.predicted_before) compute(work);
  };
  flow.write = [this, &progress](unit::UnitWork& work) {
    if (!work.predicted_before) {
      store_.save(*work.unit, to_table(results_of(*work.unit), instruments_.plan->settings.size()));
    }
    progress.advance(static_cast<std::int64_t>(work.unit->count), work.predicted_before);
  };
  return flow;
}

std::span<SampleResult> Evaluator::results_of(const candidates::Unit& unit) {
  return std::span(results_).subspan(unit.first, unit.count);
}

// Loads the results of an earlier run, or of another rank. Returns whether there are any.
bool Evaluator::load(const candidates::Unit& unit) {
  const auto table = store_.load(unit);
  if (!table) return false;
  try {
    set_measured(*table, instruments_.plan->settings.size(), results_of(unit));
  } catch (const std::exception& error) {
    throw std::runtime_error(
        fmt::format("{}: {}; remove its folder and run again", store_.file(unit).string(), error.what()));
  }
  return true;
}

void Evaluator::decode(unit::UnitWork& work) {
  work.decoded.assign(work.candidates.size(), {});
  tbb::parallel_for(std::size_t{0}, work.candidates.size(), [&](std::size_t i) {
    const candidates::Candidate& candidate = work.candidates[i];
    if (run::interrupted() || candidate.record.failure != Reason::none) return;
    work.decoded[i] =
        unit::decode_sample(candidate, {.patch = true, .stored_crop = false, .mask_area = true}, {});
  });
}

void Evaluator::compute(const unit::UnitWork& work) {
  Measurable unit = predict(work);
  measure_setting(0, unit.bodies, unit);
  std::size_t setting = 1;
  for (const TtaPass& pass : instruments_.plan->passes) setting = adapt(pass, setting, unit);
}

Evaluator::Measurable Evaluator::predict(const unit::UnitWork& work) {
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
std::size_t Evaluator::adapt(const TtaPass& pass, std::size_t setting, const Measurable& unit) {
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
    bodies.reserve(outcomes.size());
    for (const device::AdaptOutcome& outcome : outcomes) bodies.push_back(body_of(outcome));
    measure_setting(setting++, bodies, unit);
  };
  if (pass.iterates.empty()) measure_all([](const device::AdaptOutcome& outcome) { return outcome.best; });
  for (std::size_t i = 0; i < pass.iterates.size(); ++i) {
    measure_all([i](const device::AdaptOutcome& outcome) { return outcome.snapshots[i]; });
  }
  return setting;
}

void Evaluator::measure_setting(std::size_t setting, std::span<const device::BodyPrediction> bodies,
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

}  // namespace q3d::pipeline::evaluation
