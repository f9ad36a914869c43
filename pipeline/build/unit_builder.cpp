#include "pipeline/build/unit_builder.h"

#include <utility>

#include "filters/guards.h"
#include "pipeline/build/measuring_models.h"
#include "pipeline/dataset/dataset_manifest.h"
#include "pipeline/unit/decode.h"
#include "pipeline/unit/encode.h"
#include "pipeline/unit/judge.h"
#include "pipeline/unit/predict.h"
#include "pipeline/unit/refine.h"
#include "pipeline/unit/shard_assembly.h"
#include "pipeline/unit/unit_flow.h"
#include "pipeline/unit/unit_tables.h"

namespace q3d::pipeline::build {

using stages::Stage;

UnitBuilder::UnitBuilder(const config::BuildConfig& config, const config::JudgingRules& rules,
                         const stages::StageKeys& keys, Stage until, Workspace& workspace, RankShare& ranks)
    : config_(config),
      rules_(rules),
      keys_(keys),
      until_(until),
      workspace_(workspace),
      ranks_(ranks),
      predictions_(workspace.out(), "predict", keys.predict, &candidates::Unit::input_digest,
                   ranks.of_store()),
      refinements_(workspace.out(), "refine", keys.refine, &candidates::Unit::input_digest, ranks.of_store()),
      crops_(workspace.out(), "crops", keys.crops, &candidates::Unit::input_digest, ranks.of_store()),
      shards_(workspace.out(), "shards", keys.shards, &candidates::Unit::label_digest, ranks.of_store()),
      terms_(dataset::terms_of_datasets(config)),
      judgements_(workspace.scratch(), workspace.ingest().units.size()),
      progress_(
          rules,
          {.judges = makes(Stage::fidelity),
           .refines = makes(Stage::refine),
           .measures = makes(Stage::measure) && (filters::is_any_on(rules.guards) || rules.min_trust > 0.0)},
          static_cast<std::int64_t>(workspace.ingest().candidates.size()),
          static_cast<std::int64_t>(workspace.ingest().units.size()), workspace.quiet()) {
  // Measurements go by the labels' digest, because a vetoed candidate is not measured. Without pseudo labels
  // there is no key.
  if (!keys.measure.empty() && makes(Stage::measure)) {
    measurements_.emplace(workspace.out(), "measure", keys.measure, &candidates::Unit::label_digest,
                          ranks.of_store());
  }
}

void UnitBuilder::run() {
  if (measurements_) {  // before any work, so that missing priors are reported at once
    workspace_.device().run(
        [this] { measurer_ = std::make_unique<unit::LabelMeasurer>(load_measuring_models(config_)); });
  }
  if (!ranks_.is_shared()) {
    unit::run_units(flow(), workspace_.device());
    return;
  }
  ranks_.make(flow(), workspace_.device(), &UnitProgress::counts_of,
              [this](const UnitProgress::Counts& counts) { progress_.others(counts); });
  if (ranks_.leads()) collect();
}

unit::UnitFlow UnitBuilder::flow() {
  unit::UnitFlow flow;
  flow.units = static_cast<std::int64_t>(workspace_.ingest().units.size());
  flow.read = [this](std::int64_t index) { return read(index); };
  flow.decode = [this](unit::UnitWork& work) { decode(work); };
  flow.compute = [this](unit::UnitWork& work) { compute(work); };
  flow.encode = [this](unit::UnitWork& work) {
    if (makes(Stage::crops)) unit::encode_crops(work, config_.shards);
  };
  flow.write = [this](unit::UnitWork& work) { write(work); };
  return flow;
}

// Takes over the units that the other ranks have made, and makes those that a dead rank has left undone.
void UnitBuilder::collect() {
  for (stages::StageStore* store : {&predictions_, &refinements_, &crops_, &shards_})
    store->take_over_ranks();
  if (measurements_) measurements_->take_over_ranks();
  progress_.others({});  // these units are counted by their verdicts now
  unit::UnitFlow rest = flow();
  rest.claim = [this, next = std::int64_t{0}]() mutable -> std::optional<std::int64_t> {
    const auto units = static_cast<std::int64_t>(judgements_.units());
    while (next < units && judgements_.has(next)) ++next;
    return next < units ? std::optional(next++) : std::nullopt;
  };
  unit::run_units(rest, workspace_.device());
}

std::shared_ptr<unit::UnitWork> UnitBuilder::read(std::int64_t index) {
  const std::shared_ptr<unit::UnitWork> work = unit::open_unit(workspace_.ingest(), index);
  if (const auto table = predictions_.load(*work->unit))
    unit::set_predictions(*work, unit::predicted_from_table(*table));
  if (const auto table = refinements_.load(*work->unit)) work->refined = unit::refined_from_table(*table);
  if (measurements_) {
    if (const auto table = measurements_->load(*work->unit))
      work->measured = unit::measured_from_table(*table);
  }
  work->predicted_before = work->predicted.has_value();
  work->refined_before = work->refined.has_value();
  work->measured_before = work->measured.has_value();
  if (work->predicted) unit::judge_unit(*work, rules_);
  return work;
}

void UnitBuilder::decode(unit::UnitWork& work) {
  // These calls read whole files, so they are made here, where several units are processed at once. A run
  // that ends before the crops needs no more of them than one that finds the shard.
  work.shard_before = !makes(Stage::crops) || shards_.has(*work.unit);
  // A repair also makes the unit's stored crops again, although nothing would read them otherwise.
  if (workspace_.rebuilds() && !crops_.has(*work.unit)) work.shard_before = false;
  if (!work.shard_before) {
    if (auto table = crops_.load(*work.unit)) work.crops = unit::crops_from_table(std::move(*table));
  }
  unit::decode_unit(work, config_.shards, makes(Stage::refine) ? &rules_ : nullptr);
}

// Runs the paper's Stage 2 on one unit.
void UnitBuilder::compute(unit::UnitWork& work) {
  const unit::NetworkSource network = [this]() -> device::Network& { return workspace_.network(); };
  if (!work.predicted) {
    unit::predict_unit(work, network, watch(config_.network.batch), makes(Stage::refine) ? &rules_ : nullptr);
  }
  unit::judge_unit(work, rules_);
  if (makes(Stage::refine)) judge_and_refine(work, network);
  progress_.finish(work, was_done(work));
}

void UnitBuilder::judge_and_refine(unit::UnitWork& work, const unit::NetworkSource& network) {
  unit::free_unneeded_crops(work, rules_);
  if (!work.refined) {
    unit::refine_unit(work, network, rules_, &progress_);
    unit::judge_unit(work, rules_);
  }
  if (measurements_ && !work.measured) {
    work.measured = measurer_->measure(work, network, watch(config_.network.batch));
    unit::judge_unit(work, rules_);
  }
}

// Returns whether an earlier run had already made everything that this run makes of the unit.
bool UnitBuilder::was_done(const unit::UnitWork& work) const {
  return work.predicted_before && (!makes(Stage::refine) || work.refined_before) &&
         (!measurements_ || work.measured_before) && (!makes(Stage::shards) || work.shard_before);
}

void UnitBuilder::write(unit::UnitWork& work) {
  const candidates::Unit& unit = *work.unit;
  if (!work.predicted_before) predictions_.save(unit, unit::to_table(work.candidates, *work.predicted));
  if (work.refined && !work.refined_before) refinements_.save(unit, unit::to_table(*work.refined));
  if (work.measured && !work.measured_before) measurements_->save(unit, unit::to_table(*work.measured));
  // The crops are saved before the shard, so that a build which is killed in between need not encode them
  // again.
  if (work.crops_encoded > 0) crops_.save(unit, unit::to_table(work.crops));
  crops_encoded_ += static_cast<std::int64_t>(work.crops_encoded);
  if (makes(Stage::shards) && !work.shard_before) write_unit_shard(work);
  judgements_.set(unit.index, work.judgements);
}

void UnitBuilder::write_unit_shard(unit::UnitWork& work) {
  const std::vector<manifests::ShardSample> samples = unit::shard_samples(work);
  manifests::ShardHeader header;
  header.dataset = config_.name;
  header.version = keys_.shards;
  header.unit = work.unit->index;
  header.image_encoding = config_.shards.images;
  for (const candidates::Candidate& candidate : work.candidates) {
    const std::string name = candidates::dataset_key(candidate.record);
    header.datasets[name] = terms_.at(name);
  }
  shards_.save(*work.unit, static_cast<std::int64_t>(samples.size()), [&](const std::filesystem::path& path) {
    return manifests::write_shard(path, header, samples);
  });
}

}  // namespace q3d::pipeline::build
