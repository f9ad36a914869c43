#include "pipeline/build/build.h"

#include <chrono>
#include <cmath>
#include <map>
#include <memory>
#include <optional>

#include "manifests/shard.h"
#include "pipeline/build/measuring_models.h"
#include "pipeline/build/publish.h"
#include "pipeline/build/quality.h"
#include "pipeline/build/workspace.h"
#include "pipeline/run/log.h"
#include "pipeline/run/progress.h"
#include "pipeline/stages/stage_store.h"
#include "pipeline/unit/decode.h"
#include "pipeline/unit/encode.h"
#include "pipeline/unit/judge.h"
#include "pipeline/unit/label_measurer.h"
#include "pipeline/unit/predict.h"
#include "pipeline/unit/refine.h"
#include "pipeline/unit/shard_assembly.h"
#include "pipeline/unit/unit_flow.h"
#include "pipeline/unit/unit_tables.h"

namespace q3d::pipeline::build {
namespace {

// Takes every unit through the stages, using what earlier runs left in the stages' folders.
class UnitBuilder {
 public:
  UnitBuilder(const config::BuildConfig& config, const config::JudgingRules& rules,
              const stages::StageKeys& keys, Workspace& workspace)
      : config_(config),
        rules_(rules),
        keys_(keys),
        workspace_(workspace),
        predictions_(workspace.out(), "predict", keys.predict),
        refinements_(workspace.out(), "refine", keys.refine),
        crops_(workspace.out(), "crops", keys.crops),
        shards_(workspace.out(), "shards", keys.shards, &candidates::Unit::label_digest),
        terms_(dataset::terms_of_datasets(config)),
        judgements_(workspace.ingest().candidates.size()),
        progress_("candidates", static_cast<std::int64_t>(workspace.ingest().candidates.size()),
                  workspace.quiet()) {
    // Measurements go by the labels' digest, because a vetoed candidate is not measured. Without pseudo
    // labels there is no key.
    if (!keys.measure.empty()) {
      measurements_.emplace(workspace.out(), "measure", keys.measure, &candidates::Unit::label_digest);
    }
  }

  void run() {
    if (measurements_) {  // before any work, so that missing priors are told at once
      workspace_.device().run(
          [this] { measurer_ = std::make_unique<unit::LabelMeasurer>(load_measuring_models(config_)); });
    }
    unit::UnitFlow flow;
    flow.units = static_cast<std::int64_t>(workspace_.ingest().units.size());
    flow.read = [this](std::int64_t index) { return read(index); };
    flow.decode = [this](unit::UnitWork& work) {
      // Here, because several units are decoded at once: these read whole files.
      work.shard_before = shards_.has(*work.unit);
      if (!work.shard_before) {
        if (auto table = crops_.load(*work.unit)) work.crops = unit::crops_from_table(std::move(*table));
      }
      unit::decode_unit(work, config_.shards, &rules_);
    };
    flow.compute = [this](unit::UnitWork& work) { compute(work); };
    flow.encode = [this](unit::UnitWork& work) { unit::encode_crops(work, config_.shards); };
    flow.write = [this](unit::UnitWork& work) { write(work); };
    unit::run_units(flow, workspace_.device());
  }

  const std::vector<manifests::Judgement>& judgements() const { return judgements_; }
  stages::StageStore& shards() { return shards_; }
  std::int64_t crops_encoded() const { return crops_encoded_; }

 private:
  std::shared_ptr<unit::UnitWork> read(std::int64_t index) {
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

  // The paper's Stage 2 on one unit.
  void compute(unit::UnitWork& work) {
    const unit::NetworkSource network = [this]() -> device::Network& { return workspace_.network(); };
    if (!work.predicted) unit::predict_unit(work, network);
    unit::judge_unit(work, rules_);
    unit::free_unneeded_crops(work, rules_);
    if (!work.refined) {
      unit::refine_unit(work, network, rules_);
      unit::judge_unit(work, rules_);
    }
    if (measurements_ && !work.measured) {
      work.measured = measurer_->measure(work, network);
      unit::judge_unit(work, rules_);
    }
  }

  void write(unit::UnitWork& work) {
    const candidates::Unit& unit = *work.unit;
    if (!work.predicted_before) predictions_.save(unit, unit::to_table(work.candidates, *work.predicted));
    if (!work.refined_before) refinements_.save(unit, unit::to_table(*work.refined));
    if (work.measured && !work.measured_before) measurements_->save(unit, unit::to_table(*work.measured));
    // Before the shard, so that a build which is killed in between has no crop to encode again.
    if (work.crops_encoded > 0) crops_.save(unit, unit::to_table(work.crops));
    crops_encoded_ += static_cast<std::int64_t>(work.crops_encoded);
    if (!work.shard_before) write_unit_shard(work);
    std::copy(work.judgements.begin(), work.judgements.end(),
              judgements_.begin() + static_cast<std::ptrdiff_t>(unit.first));
    progress_.advance(static_cast<std::int64_t>(unit.count), work.shard_before);
  }

  void write_unit_shard(unit::UnitWork& work) {
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
    shards_.save(
        *work.unit, static_cast<std::int64_t>(samples.size()),
        [&](const std::filesystem::path& path) { return manifests::write_shard(path, header, samples); });
  }

  const config::BuildConfig& config_;
  const config::JudgingRules& rules_;
  const stages::StageKeys& keys_;
  Workspace& workspace_;
  stages::StageStore predictions_;
  stages::StageStore refinements_;
  stages::StageStore crops_;
  stages::StageStore shards_;
  std::optional<stages::StageStore> measurements_;        // where there are pseudo labels
  std::unique_ptr<unit::LabelMeasurer> measurer_;         // made and used on the device's thread
  std::map<std::string, manifests::DatasetTerms> terms_;  // by candidates::dataset_key
  std::vector<manifests::Judgement> judgements_;          // of every candidate, in ingest order
  std::int64_t crops_encoded_ = 0;                        // in this run
  run::Progress progress_;
};

// The datasets with pseudo labels, by name, with the errors of their predictions.
std::vector<PoolErrors> pools_of(const config::JudgingRules& rules, const candidates::Ingest& ingest,
                                 const std::vector<manifests::Judgement>& judgements) {
  std::map<std::string, PoolErrors> pools;
  for (const auto& [name, thresholds] : rules.thresholds) pools[name] = {name, true, {}, thresholds.tau_high};
  for (std::size_t i = 0; i < judgements.size(); ++i) {
    const candidates::Candidate& candidate = ingest.candidates[i];
    if (candidate.role != config::Role::pseudo) continue;
    PoolErrors& pool = pools.at(candidate.record.dataset);
    if (ingest.rendered.count(candidates::dataset_key(candidate.record)) == 0) pool.is_rendered = false;
    if (!std::isnan(judgements[i].initial_error)) pool.errors.push_back(judgements[i].initial_error);
  }
  std::vector<PoolErrors> list;
  for (auto& [name, pool] : pools) list.push_back(std::move(pool));
  return list;
}

}  // namespace

BuildSummary build(const config::BuildConfig& config, const run::RunOptions& options) {
  config::require_keypoints(config);
  const auto start = std::chrono::steady_clock::now();
  const config::JudgingRules rules = config::judging_rules(config);
  if (!options.above_ceiling) {
    for (const auto& [name, thresholds] : rules.thresholds) {
      require_below_ceiling(name, thresholds.tau_high, config.filter.tau_ceiling);
    }
  }
  Workspace workspace(config, options);
  const stages::StageKeys keys =
      stages::stage_keys(config, rules, workspace.ingest(), workspace.assets(), workspace.device_key());

  BuildSummary summary;
  summary.folder = version_folder(options.out, config, keys);
  summary.was_up_to_date = is_published(summary.folder, keys, workspace.digests());
  workspace.digests().save();
  if (!summary.was_up_to_date) {
    UnitBuilder units(config, rules, keys, workspace);
    units.run();
    summary.crops_encoded = units.crops_encoded();
    const dataset::DatasetInputs inputs{
        &config,
        &rules,
        &workspace.ingest(),
        &workspace.assets(),
        &keys,
        workspace.device_key(),
        quality_warnings(pools_of(rules, workspace.ingest(), units.judgements()), workspace.origins(),
                         config.filter.tau_ceiling)};
    publish(summary.folder, inputs, units.judgements(), units.shards());
  }
  summary.notes = workspace.ingest().notes;
  summary.dataset = dataset::read_dataset_manifest(summary.folder);
  for (const dataset::Warning& warning : summary.dataset.warnings) run::log_warning(warning.message);
  require_labels(summary.dataset, summary.folder);
  point_latest(options.out, summary.folder);
  summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

}  // namespace q3d::pipeline::build
