#include "pipeline/build/build.h"

#include <chrono>
#include <memory>
#include <optional>

#include "manifests/shard.h"
#include "pipeline/build/measuring_models.h"
#include "pipeline/build/publish.h"
#include "pipeline/build/workspace.h"
#include "pipeline/run/progress.h"
#include "pipeline/stages/stage_store.h"
#include "pipeline/unit/decode.h"
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
        predictions_(workspace.out(), "predict", keys.predict, workspace.warn()),
        refinements_(workspace.out(), "refine", keys.refine, workspace.warn()),
        shards_(workspace.out(), "shards", keys.shards, workspace.warn(), &candidates::Unit::label_digest),
        judgements_(workspace.ingest().candidates.size()),
        progress_("candidates", static_cast<std::int64_t>(workspace.ingest().candidates.size()),
                  workspace.quiet()) {
    // By the labels' digest: what a veto leaves out is not measured.
    if (!keys.measure.empty()) {
      measurements_.emplace(workspace.out(), "measure", keys.measure, workspace.warn(),
                            &candidates::Unit::label_digest);
    }
  }

  void run() {
    if (measurements_) {  // before any work, so that missing priors are told at once
      workspace_.device().run([this] {
        measurer_ = std::make_unique<unit::LabelMeasurer>(config_.guards, load_measuring_models(config_));
      });
    }
    unit::UnitFlow flow;
    flow.units = static_cast<std::int64_t>(workspace_.ingest().units.size());
    flow.read = [this](std::int64_t index) { return read(index); };
    flow.decode = [this](unit::UnitWork& work) {
      // Here, because several units are decoded at once: it reads the whole shard.
      work.shard_before = shards_.has(*work.unit);
      unit::decode_unit(work, config_.shards, &rules_);
    };
    flow.compute = [this](unit::UnitWork& work) { compute(work); };
    flow.write = [this](unit::UnitWork& work) { write(work); };
    unit::run_units(flow, workspace_.device());
  }

  const std::vector<manifests::Judgement>& judgements() const { return judgements_; }
  stages::StageStore& shards() { return shards_; }

 private:
  std::shared_ptr<unit::UnitWork> read(std::int64_t index) {
    const candidates::Ingest& ingest = workspace_.ingest();
    auto work = std::make_shared<unit::UnitWork>();
    work->unit = &ingest.units[static_cast<std::size_t>(index)];
    work->candidates = std::span(ingest.candidates).subspan(work->unit->first, work->unit->count);
    if (const auto table = predictions_.load(*work->unit))
      work->predicted = unit::predicted_from_table(*table);
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
    if (!work.refined) {
      unit::refine_unit(work, network, rules_);
      unit::judge_unit(work, rules_);
    }
    if (measurements_ && !work.measured) {
      work.measured = measurer_->measure(work);
      unit::judge_unit(work, rules_);
    }
  }

  void write(unit::UnitWork& work) {
    const candidates::Unit& unit = *work.unit;
    if (!work.predicted_before) predictions_.save(unit, unit::to_table(work.candidates, *work.predicted));
    if (!work.refined_before) refinements_.save(unit, unit::to_table(*work.refined));
    if (work.measured && !work.measured_before) measurements_->save(unit, unit::to_table(*work.measured));
    if (!work.shard_before) write_unit_shard(work);
    std::copy(work.judgements.begin(), work.judgements.end(),
              judgements_.begin() + static_cast<std::ptrdiff_t>(unit.first));
    progress_.advance(static_cast<std::int64_t>(unit.count), work.shard_before);
  }

  void write_unit_shard(const unit::UnitWork& work) {
    const std::vector<manifests::ShardSample> samples = unit::shard_samples(work);
    manifests::ShardHeader header;
    header.dataset = config_.name;
    header.version = keys_.shards;
    header.unit = work.unit->index;
    header.image_encoding = config_.shards.images;
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
  stages::StageStore shards_;
  std::optional<stages::StageStore> measurements_;  // where the rules measure labels
  std::unique_ptr<unit::LabelMeasurer> measurer_;   // made and used on the device's thread
  std::vector<manifests::Judgement> judgements_;    // of every candidate, in ingest order
  run::Progress progress_;
};

}  // namespace

BuildSummary build(const config::BuildConfig& config, const run::RunOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  const config::JudgingRules rules = config::judging_rules(config);
  Workspace workspace(config, options);
  const stages::StageKeys keys =
      stages::stage_keys(config, rules, workspace.ingest(), workspace.assets(), workspace.device_key());

  BuildSummary summary;
  summary.folder = version_folder(options.out, config, keys);
  summary.was_up_to_date = is_published(summary.folder, keys, workspace.digests(), workspace.warn());
  workspace.digests().save();
  if (!summary.was_up_to_date) {
    UnitBuilder units(config, rules, keys, workspace);
    units.run();
    const dataset::DatasetInputs inputs{
        &config, &rules, &workspace.ingest(), &workspace.assets(), &keys, workspace.device_key()};
    publish(summary.folder, inputs, units.judgements(), units.shards());
  }
  point_latest(options.out, summary.folder);
  summary.dataset = dataset::read_dataset_manifest(summary.folder);
  summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

}  // namespace q3d::pipeline::build
