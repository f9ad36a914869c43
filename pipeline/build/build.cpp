#include "pipeline/build/build.h"

#include <chrono>
#include <cmath>
#include <map>

#include "pipeline/build/publish.h"
#include "pipeline/build/quality.h"
#include "pipeline/build/unit_builder.h"
#include "pipeline/build/workspace.h"
#include "pipeline/run/log.h"

namespace q3d::pipeline::build {
namespace {

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

void publish_units(const config::BuildConfig& config, const config::JudgingRules& rules, Workspace& workspace,
                   const BuildSummary& summary, UnitBuilder& units) {
  const dataset::DatasetInputs inputs{
      &config,
      &rules,
      &workspace.ingest(),
      &workspace.assets(),
      &summary.plan.keys,
      workspace.device_key(),
      quality_warnings(pools_of(rules, workspace.ingest(), units.judgements()), workspace.origins(),
                       config.filter.tau_ceiling)};
  publish(summary.folder, inputs, units.judgements(), units.shards());
}

}  // namespace

BuildSummary build(const config::BuildConfig& config, const run::RunOptions& options,
                   const BuildRequest& request) {
  const auto start = std::chrono::steady_clock::now();
  const config::JudgingRules rules = checked_rules(config, options.above_ceiling);
  Workspace workspace(config, options);
  BuildSummary summary;
  summary.plan = stages::plan_of(config, rules, workspace.ingest(), workspace.assets(),
                                 workspace.device_key(), request.command);
  const stages::StageKeys& keys = summary.plan.keys;
  stages::write_build_plan(options.out, summary.plan);
  summary.folder = version_folder(options.out, config, keys);
  summary.notes = workspace.ingest().notes;
  summary.was_up_to_date = is_published(summary.folder, keys) && !options.rebuild;
  workspace.digests().save();
  const auto seconds = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  if (!summary.was_up_to_date) {
    const stages::Stage until = request.until.value_or(stages::Stage::shards);
    UnitBuilder units(config, rules, keys, until, workspace);
    if (until != stages::Stage::ingest) units.run();
    summary.crops_encoded = units.crops_encoded();
    if (request.until) {
      summary.stopped_after = until;
      summary.seconds = seconds();
      return summary;
    }
    publish_units(config, rules, workspace, summary, units);
  }
  summary.dataset = dataset::read_dataset_manifest(summary.folder);
  for (const dataset::Warning& warning : summary.dataset.warnings) run::log_warning(warning.message);
  require_labels(summary.dataset, summary.folder);
  if (!options.rebuild) point_latest(options.out, summary.folder);
  summary.seconds = seconds();
  return summary;
}

}  // namespace q3d::pipeline::build
