#include "pipeline/build.h"

#include <chrono>
#include <memory>

#include "manifests/shard.h"
#include "pipeline/progress.h"
#include "pipeline/publish.h"
#include "pipeline/shard_assembly.h"
#include "pipeline/stage_store.h"
#include "pipeline/unit_flow.h"
#include "pipeline/unit_steps.h"
#include "pipeline/unit_tables.h"
#include "pipeline/workspace.h"

namespace q3d::pipeline {
namespace {

// Takes every unit through the stages, using what earlier runs left in the stages' folders.
class UnitBuilder {
 public:
  UnitBuilder(const BuildConfig& config, const filters::Thresholds& thresholds, const StageKeys& keys,
              Workspace& workspace)
      : config_(config),
        thresholds_(thresholds),
        keys_(keys),
        workspace_(workspace),
        predictions_(workspace.out(), "predict", keys.predict),
        refinements_(workspace.out(), "refine", keys.refine),
        shards_(workspace.out(), "shards", keys.shards, &Unit::label_digest),
        judgements_(workspace.ingest().candidates.size()),
        progress_("candidates", static_cast<std::int64_t>(workspace.ingest().candidates.size()),
                  workspace.quiet()) {}

  void run() {
    UnitFlow flow;
    flow.units = static_cast<std::int64_t>(workspace_.ingest().units.size());
    flow.read = [this](std::int64_t index) { return read(index); };
    flow.decode = [this](UnitWork& work) { decode_unit(work, config_.shards, &thresholds_); };
    flow.compute = [this](UnitWork& work) { compute(work); };
    flow.write = [this](UnitWork& work) { write(work); };
    pipeline::run(flow, workspace_.device());
  }

  const std::vector<manifests::Judgement>& judgements() const { return judgements_; }
  const StageStore& shards() const { return shards_; }

 private:
  std::shared_ptr<UnitWork> read(std::int64_t index) {
    const Ingest& ingest = workspace_.ingest();
    auto work = std::make_shared<UnitWork>();
    work->unit = &ingest.units[static_cast<std::size_t>(index)];
    work->candidates = std::span(ingest.candidates).subspan(work->unit->first, work->unit->count);
    if (const auto table = predictions_.load(*work->unit)) work->predicted = predicted_from_table(*table);
    if (const auto table = refinements_.load(*work->unit)) work->refined = refined_from_table(*table);
    work->predicted_before = work->predicted.has_value();
    work->refined_before = work->refined.has_value();
    work->shard_before = shards_.has(*work->unit);
    if (work->predicted) judge_unit(*work, thresholds_);
    return work;
  }

  // The paper's Stage 2 on one unit.
  void compute(UnitWork& work) {
    const NetworkSource network = [this]() -> Network& { return workspace_.network(); };
    if (!work.predicted) predict_unit(work, network);
    judge_unit(work, thresholds_);
    if (!work.refined) {
      refine_unit(work, network, thresholds_);
      judge_unit(work, thresholds_);
    }
  }

  void write(UnitWork& work) {
    const Unit& unit = *work.unit;
    if (!work.predicted_before) predictions_.save(unit, to_table(work.candidates, *work.predicted));
    if (!work.refined_before) refinements_.save(unit, to_table(*work.refined));
    if (!work.shard_before) write_unit_shard(work);
    std::copy(work.judgements.begin(), work.judgements.end(),
              judgements_.begin() + static_cast<std::ptrdiff_t>(unit.first));
    progress_.advance(static_cast<std::int64_t>(unit.count), work.shard_before);
  }

  void write_unit_shard(const UnitWork& work) {
    const std::vector<manifests::ShardSample> samples = shard_samples(work);
    manifests::ShardHeader header;
    header.dataset = config_.name;
    header.version = keys_.shards;
    header.unit = work.unit->index;
    header.image_encoding = config_.shards.images;
    shards_.save(
        *work.unit, static_cast<std::int64_t>(samples.size()),
        [&](const std::filesystem::path& path) { return manifests::write_shard(path, header, samples); });
  }

  const BuildConfig& config_;
  const filters::Thresholds& thresholds_;
  const StageKeys& keys_;
  Workspace& workspace_;
  StageStore predictions_;
  StageStore refinements_;
  StageStore shards_;
  std::vector<manifests::Judgement> judgements_;  // of every candidate, in ingest order
  Progress progress_;
};

}  // namespace

BuildSummary build(const BuildConfig& config, const RunOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  const filters::Thresholds limits = needs_network(config) ? thresholds(config) : filters::Thresholds{};
  Workspace workspace(config, options);
  const StageKeys keys =
      stage_keys(config, limits, workspace.ingest(), workspace.assets(), workspace.device_key());

  BuildSummary summary;
  summary.folder = version_folder(options.out, config, keys);
  summary.was_up_to_date = is_published(summary.folder, keys);
  if (!summary.was_up_to_date) {
    UnitBuilder units(config, limits, keys, workspace);
    units.run();
    const DatasetInputs inputs{
        &config, &limits, &workspace.ingest(), &workspace.assets(), &keys, workspace.device_key()};
    publish(summary.folder, inputs, units.judgements(), units.shards());
  }
  point_latest(options.out, summary.folder);
  summary.dataset = read_dataset_manifest(summary.folder);
  summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

}  // namespace q3d::pipeline
