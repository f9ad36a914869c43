#include "pipeline/build/build.h"

#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "manifests/lock.h"
#include "pipeline/build/publish.h"
#include "pipeline/build/quality.h"
#include "pipeline/build/rank_share.h"
#include "pipeline/build/unit_builder.h"
#include "pipeline/build/up_to_date.h"
#include "pipeline/build/workspace.h"
#include "pipeline/dataset/is_published.h"
#include "pipeline/network/torch_network.h"
#include "pipeline/run/log.h"

namespace q3d::pipeline::build {
namespace {

// Returns the datasets with pseudo labels, by name, with the errors of their predictions.
std::vector<PoolErrors> pools_of(const config::JudgingRules& rules, const candidates::Ingest& ingest,
                                 const dataset::JudgementList& judgements) {
  if (rules.thresholds.empty()) return {};
  std::map<std::string, PoolErrors> pools;
  for (const auto& [name, thresholds] : rules.thresholds) pools[name] = {name, true, {}, thresholds.tau_high};
  const auto add = [&](const auto&, const auto& candidate, const auto& judgement) {
    if (candidate.role != config::Role::pseudo) return;
    PoolErrors& pool = pools.at(candidate.record.dataset);
    if (ingest.rendered.count(candidates::dataset_key(candidate.record)) == 0) pool.is_rendered = false;
    if (!std::isnan(judgement.initial_error)) pool.errors.push_back(judgement.initial_error);
  };
  dataset::for_each_verdict(ingest, judgements, add);
  std::vector<PoolErrors> list;
  list.reserve(pools.size());
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

// Makes this rank's units. In rank 0 the dataset can then be published, unless the request ends at an earlier
// stage.
void make_units(const config::BuildConfig& config, const config::JudgingRules& rules,
                const BuildRequest& request, RankShare& ranks, Workspace& workspace, BuildSummary& summary) {
  const stages::Stage until = request.until.value_or(stages::Stage::shards);
  const auto make = [&] {
    return std::make_unique<UnitBuilder>(config, rules, summary.plan.keys, until, workspace, ranks);
  };
  std::unique_ptr<UnitBuilder> units;
  if (ranks.leads() && !summary.was_up_to_date) units = make();  // takes over the results of an earlier run
  summary.was_up_to_date = ranks.agree(summary.plan.keys.dataset, summary.was_up_to_date);
  if (summary.was_up_to_date) return;
  if (!units) units = make();
  if (until != stages::Stage::ingest) units->run();
  summary.crops_encoded = units->crops_encoded();
  if (request.until) {
    summary.stopped_after = until;
  } else if (ranks.leads()) {
    publish_units(config, rules, workspace, summary, *units);
  }
}

// Makes the units of a rank other than 0. Rank 0 may have ended already if other ranks made the last units
// too; this is no error.
void make_units_beside_leader(const config::BuildConfig& config, const config::JudgingRules& rules,
                              const BuildRequest& request, RankShare& ranks, Workspace& workspace,
                              BuildSummary& summary) {
  try {
    make_units(config, rules, request, ranks, workspace, summary);
  } catch (const LeaderLost&) {
    if (!std::filesystem::exists(summary.folder / "dataset.json")) throw;
  }
}

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Returns the device's name in the build's keys. A missing checkpoint is reported when it is read.
std::string device_of(const config::BuildConfig& config) {
  const bool has_network =
      config::needs_network(config) && std::filesystem::exists(config.network.checkpoint);
  return has_network ? network::device_key(config.network) : std::string();
}

// Returns the plan of a finished version, or nothing if it is gone or damaged.
std::optional<stages::BuildPlan> plan_of_version(const std::filesystem::path& out,
                                                 const std::string& version) {
  for (stages::BuildPlan& plan : stages::read_build_plans(out)) {
    if (stages::version_name(plan.name, plan.keys) == version) return std::move(plan);
  }
  return std::nullopt;
}

// Fills the summary from the record of an earlier build if nothing has changed since. A build whose plan is
// missing runs in full, which writes the plan again.
bool is_unchanged(const run::RunOptions& options, const UpToDateRecord& record, BuildSummary& summary) {
  auto found = record.unchanged();
  if (!found) return false;
  auto plan = plan_of_version(options.out, found->folder.filename().string());
  if (!plan) return false;
  log_candidates(found->candidates, found->units, options.quiet);
  log_notes(found->notes, options.quiet);
  summary.was_up_to_date = true;
  summary.plan = std::move(*plan);
  summary.folder = std::move(found->folder);
  summary.notes = std::move(found->notes);
  return true;
}

// Reports the quality of a finished dataset and makes it the newest. The caller holds the folder's lock.
void finish(const config::BuildConfig& config, const run::RunOptions& options, BuildSummary& summary,
            Clock::time_point start) {
  summary.dataset = dataset::read_dataset_manifest(summary.folder);
  for (const dataset::Warning& warning : summary.dataset.warnings) run::log_warning(warning.message);
  require_labels(summary.dataset, summary.folder, config.max_failed_share);
  if (!options.rebuild) point_latest(options.out, summary.folder);
  summary.seconds = seconds_since(start);
}

}  // namespace

BuildSummary build(const config::BuildConfig& config, const run::RunOptions& options,
                   const BuildRequest& request) {
  const auto start = Clock::now();
  const config::JudgingRules rules = checked_rules(config, options.above_ceiling);
  RankShare ranks(config::needs_network(config) ? &config.network : nullptr, options, "build");
  config::BuildConfig own = config;
  own.network = ranks.own(config.network);
  BuildSummary summary;
  summary.rank = ranks.rank();
  const UpToDateRecord record(options.out, config, rules, device_of(config));
  if (ranks.leads() && !options.rebuild && is_unchanged(options, record, summary)) {
    ranks.end();
    const manifests::FolderLock lock(options.out);
    finish(config, options, summary, start);
    return summary;
  }
  if (!ranks.await_digests()) return summary;
  Workspace workspace(own, ranks.options(), ranks.leads() ? Workspace::Use::work : Workspace::Use::join);
  ranks.tell_digests();
  summary.plan = stages::plan_of(config, rules, workspace.ingest(), workspace.assets(),
                                 workspace.device_key(), request.command);
  const stages::StageKeys& keys = summary.plan.keys;
  summary.folder = version_folder(options.out, config, keys);
  if (!ranks.leads()) {
    make_units_beside_leader(own, rules, request, ranks, workspace, summary);
    return summary;
  }
  stages::write_build_plan(options.out, summary.plan);
  summary.notes = workspace.ingest().notes;
  summary.was_up_to_date = dataset::is_published(summary.folder, keys.dataset) && !options.rebuild;
  workspace.digests().save();
  make_units(own, rules, request, ranks, workspace, summary);
  ranks.end();
  if (summary.stopped_after) {
    summary.seconds = seconds_since(start);
    return summary;
  }
  record.keep(workspace.ingest(), summary.folder);
  finish(config, options, summary, start);
  return summary;
}

}  // namespace q3d::pipeline::build
