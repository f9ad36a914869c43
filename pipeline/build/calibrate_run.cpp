#include "pipeline/build/calibrate_run.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <stdexcept>
#include <utility>

#include "filters/metrics.h"
#include "loaders/pictures/crop.h"
#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "pipeline/build/prediction_progress.h"
#include "pipeline/build/quality.h"
#include "pipeline/build/rank_share.h"
#include "pipeline/build/workspace.h"
#include "pipeline/run/errors.h"
#include "pipeline/run/interrupt.h"
#include "pipeline/run/log.h"
#include "pipeline/run/progress.h"
#include "pipeline/stages/stage_store.h"
#include "pipeline/unit/crop_keypoints.h"
#include "pipeline/unit/decode.h"
#include "pipeline/unit/judge.h"
#include "pipeline/unit/predict.h"
#include "pipeline/unit/refine.h"
#include "pipeline/unit/unit_flow.h"
#include "pipeline/unit/unit_tables.h"

namespace q3d::pipeline::build {
namespace {

constexpr std::size_t kCurvePoints = 200;
constexpr double kNoLimit = std::numeric_limits<double>::infinity();

// A candidate with a prediction.
struct Scored {
  std::size_t candidate = 0;  // its place in the pool
  const config::DatasetConfig* dataset = nullptr;
  filters::ScoredSample score;
};

const config::DatasetConfig& dataset_of(const manifests::SampleRecord& record,
                                        const config::BuildConfig& config) {
  return *std::find_if(config.datasets.begin(), config.datasets.end(), [&](const auto& dataset) {
    return dataset.name == record.dataset && dataset.split == record.split;
  });
}

// Returns a flow that makes the predictions of every unit, or loads those of an earlier run. The caller adds
// `write`.
unit::UnitFlow prediction_flow(const config::BuildConfig& config, Workspace& workspace,
                               stages::StageStore& predictions, PredictionProgress& predicted) {
  unit::UnitFlow flow;
  flow.units = static_cast<std::int64_t>(workspace.ingest().units.size());
  flow.read = [&](std::int64_t index) {
    const std::shared_ptr<unit::UnitWork> work = unit::open_unit(workspace.ingest(), index);
    if (const auto table = predictions.load(*work->unit))
      unit::set_predictions(*work, unit::predicted_from_table(*table));
    work->predicted_before = work->predicted.has_value();
    return work;
  };
  flow.decode = [&](unit::UnitWork& work) { unit::decode_unit(work, config.shards, nullptr); };
  flow.compute = [&](unit::UnitWork& work) {
    if (work.predicted) return;
    unit::predict_unit(work, [&]() -> device::Network& { return workspace.network(); },
                       {&predicted, static_cast<std::size_t>(config.network.batch)});
    predicted.tell();
  };
  return flow;
}

void save_predictions(const unit::UnitWork& work, stages::StageStore& predictions) {
  if (!work.predicted_before) predictions.save(*work.unit, unit::to_table(work.candidates, *work.predicted));
}

// Lets the ranks share the predictions. Afterwards, in rank 0, `predictions` holds those of all ranks.
void predict_with_ranks(const config::BuildConfig& config, Workspace& workspace,
                        stages::StageStore& predictions, RankShare& ranks) {
  run::Progress progress("predicted", static_cast<std::int64_t>(workspace.ingest().candidates.size()),
                         workspace.quiet());
  PredictionProgress predicted(progress);
  unit::UnitFlow flow = prediction_flow(config, workspace, predictions, predicted);
  flow.write = [&](unit::UnitWork& work) {
    save_predictions(work, predictions);
    if (work.predicted_before) progress.advance(static_cast<std::int64_t>(work.unit->count), true);
  };
  ranks.make(std::move(flow), workspace.device(), progress);
  if (ranks.leads()) predictions.take_over_ranks();
}

// Returns the scores of every candidate that is not excluded, has the role `pseudo` and has a prediction, in
// ingest order.
std::vector<Scored> score_pool(const config::BuildConfig& config, Workspace& workspace,
                               stages::StageStore& predictions, bool quiet) {
  std::vector<Scored> scored;
  run::Progress progress("predicted", static_cast<std::int64_t>(workspace.ingest().candidates.size()), quiet);
  PredictionProgress predicted(progress);
  unit::UnitFlow flow = prediction_flow(config, workspace, predictions, predicted);
  flow.write = [&](unit::UnitWork& work) {
    save_predictions(work, predictions);
    for (std::size_t i = 0; i < work.candidates.size(); ++i) {
      const candidates::Candidate& candidate = work.candidates[i];
      const bool is_judged = candidate.role == config::Role::pseudo && !std::isnan(work.errors[i]);
      if (!is_judged || candidate.exclusion.reason != manifests::Reason::none) continue;
      const auto auc = filters::auc((*work.predicted)[i].body.keypoints_2d, work.keypoints[i],
                                    loaders::pictures::kPatchSidePx);
      scored.push_back({work.unit->first + i,
                        &dataset_of(candidate.record, config),
                        {work.errors[i], 100.0 * auc.value()}});
    }
    if (work.predicted_before) progress.advance(static_cast<std::int64_t>(work.unit->count), true);
  };
  unit::run_units(flow, workspace.device());
  return scored;
}

// Only rank 0 gets scores.
std::vector<Scored> predict_pool(const config::BuildConfig& config, Workspace& workspace, RankShare& ranks) {
  const std::string key = stages::predict_key(config, workspace.assets(), workspace.device_key());
  const auto open = [&] {
    return std::make_unique<stages::StageStore>(workspace.out(), "predict", key,
                                                &candidates::Unit::input_digest, ranks.of_store());
  };
  std::unique_ptr<stages::StageStore> predictions;
  if (ranks.leads()) predictions = open();  // takes over the results of an earlier run
  if (ranks.is_shared()) {
    ranks.agree(key_of_work(key, workspace.ingest().units), false);
    if (!predictions) predictions = open();
    predict_with_ranks(config, workspace, *predictions, ranks);
    ranks.end();
    if (!ranks.leads()) return {};
  }
  return score_pool(config, workspace, *predictions, workspace.quiet() || ranks.is_shared());
}

// Adapts some candidates for as long as the gain is measured and says which of them the fidelity rule would
// keep: the gain within the first iterations decides. `limits` has no tau_high, so that all of them lie in
// the middle band.
std::vector<bool> adapt_some(const std::vector<const Scored*>& candidates, const filters::Thresholds& limits,
                             const config::BuildConfig& config, Workspace& workspace) {
  std::vector<manifests::SampleRecord> records(candidates.size());
  std::vector<std::vector<std::uint8_t>> patches(candidates.size());
  tbb::parallel_for(std::size_t{0}, candidates.size(), [&](std::size_t i) {
    candidates::Candidate candidate = workspace.ingest().candidates.at(candidates[i]->candidate);
    patches[i] = unit::decode_sample(candidate, {.patch = true}, config.shards).patch;
    records[i] = std::move(candidate.record);
  });
  std::vector<device::AdaptRequest> requests;
  std::vector<std::size_t> positions;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (patches[i].empty()) continue;
    const manifests::SampleRecord& record = records[i];
    requests.push_back(unit::adapt_request(record.id, unit::crop_keypoints(record), patches[i],
                                           candidates[i]->score.initial_error, limits, config.guards));
    positions.push_back(i);
  }
  std::vector<device::AdaptOutcome> outcomes;
  workspace.device().run([&] { outcomes = workspace.network().adapt(requests); });
  std::vector<bool> passes(candidates.size(), false);
  for (std::size_t j = 0; j < outcomes.size(); ++j) {
    const Scored& scored = *candidates[positions[j]];
    unit::RefinedSample refined;
    refined.curve = std::move(outcomes[j].curve);
    refined.held_out_curve = std::move(outcomes[j].held_out_curve);
    passes[positions[j]] =
        unit::judge_refined(requests[j].keypoints, scored.score.initial_error, refined, limits, config.guards)
            .verdict == manifests::Verdict::refined;
  }
  return passes;
}

// Adapts candidates from tau_low upwards, a chunk at a time, until enough have passed. Candidates with larger
// errors keep `passes_adaptation`, because they lie beyond tau_high in any case.
std::int64_t adapt_until_enough(std::vector<filters::CalibrationSample>& pool,
                                const std::vector<Scored>& candidates, const filters::Thresholds& limits,
                                const config::BuildConfig& config, Workspace& workspace) {
  const auto chunk = static_cast<std::size_t>(config.tta.batch) * 4;
  const auto needed =
      static_cast<std::int64_t>(std::ceil(config.calibrate.refined * static_cast<double>(pool.size()))) + 1;
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < pool.size(); ++i) {
    if (pool[i].initial_error >= limits.tau_low) order.push_back(i);
  }
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::pair(pool[a].initial_error, a) < std::pair(pool[b].initial_error, b);
  });
  run::Progress progress("adapted", static_cast<std::int64_t>(order.size()), workspace.quiet());
  std::int64_t passed = 0;
  std::size_t done = 0;
  while (done < order.size() && passed < needed) {
    run::throw_if_interrupted();
    const std::size_t count = std::min(chunk, order.size() - done);
    std::vector<const Scored*> some;
    for (std::size_t i = 0; i < count; ++i) some.push_back(&candidates[order[done + i]]);
    const std::vector<bool> passes = adapt_some(some, limits, config, workspace);
    for (std::size_t i = 0; i < count; ++i) {
      pool[order[done + i]].passes_adaptation = passes[i];
      passed += passes[i] ? 1 : 0;
    }
    done += count;
    progress.advance(static_cast<std::int64_t>(count));
  }
  return static_cast<std::int64_t>(done);
}

double delta_of(const std::string& dataset, const config::FilterConfig& filter) {
  const auto own = filter.datasets.find(dataset);
  return own == filter.datasets.end() ? filter.delta : own->second.delta.value_or(filter.delta);
}

void require_stop_below(double stop_below, double tau_low) {
  if (stop_below <= tau_low) return;
  throw run::ConfigError(
      fmt::format("tta.stop_below is {}, but the pool's tau_low is {:.6g}, and adaptation may not end above "
                  "tau_low. Give a smaller number, or leave the key out",
                  stop_below, tau_low));
}

filters::CalibratedPool calibrate_pool(const std::string& dataset, const std::vector<Scored>& candidates,
                                       const config::BuildConfig& config, Workspace& workspace) {
  if (candidates.empty()) {
    throw std::runtime_error(fmt::format(
        "no candidate{} could be predicted, so there is nothing to calibrate on; `build` with any thresholds "
        "lists why in verdicts.csv",
        dataset.empty() ? "" : " of the dataset " + dataset));
  }
  std::vector<filters::CalibrationSample> pool;
  std::vector<filters::ScoredSample> scores;
  for (const Scored& scored : candidates) {
    pool.push_back({scored.score.initial_error, true});
    scores.push_back(scored.score);
  }
  filters::Thresholds base;
  base.delta = delta_of(dataset, config.filter);
  // tau_low is a quantile of the errors alone; tau_high depends on how many candidates pass adaptation.
  filters::Thresholds limits = filters::calibrate(pool, config.calibrate, base).thresholds;
  require_stop_below(config.tta.stop_below, limits.tau_low);
  limits.stop_below = config.tta.stop_below;
  limits.tau_high = kNoLimit;
  // The rule asks for the gain of the first iterations only, so no more of them are needed here.
  limits.iterations_min = limits.iterations_max = std::min(limits.gain_window, config.tta.iterations_max);
  filters::CalibratedPool result;
  result.dataset = dataset;
  result.adapted = adapt_until_enough(pool, candidates, limits, config, workspace);
  result.calibration = filters::calibrate(pool, config.calibrate, base);
  if (!workspace.above_ceiling()) {
    require_below_ceiling(dataset, result.calibration.thresholds.tau_high, config.filter.tau_ceiling);
  }
  result.judged = static_cast<std::int64_t>(pool.size());
  result.curve = filters::yield_curve(scores, kCurvePoints);
  result.at_tau_low = filters::yield_at(scores, result.calibration.thresholds.tau_low);
  result.at_tau_high = filters::yield_at(scores, result.calibration.thresholds.tau_high);
  return result;
}

// Returns the warnings about the pool that can be given before any label is made. A threshold that all
// datasets share is reported for each of them.
std::vector<dataset::Warning> warnings_of(const std::vector<Scored>& scored,
                                          const std::vector<filters::CalibratedPool>& calibrated,
                                          const config::BuildConfig& config, const Workspace& workspace) {
  std::map<std::string, PoolErrors> pools;
  for (const Scored& each : scored) {
    const std::string& name = each.dataset->name;
    PoolErrors& pool = pools.try_emplace(name, PoolErrors{name, true, {}, 0.0}).first->second;
    if (workspace.ingest().rendered.count(name + "/" + each.dataset->split) == 0) pool.is_rendered = false;
    pool.errors.push_back(each.score.initial_error);
  }
  std::vector<PoolErrors> list;
  for (auto& [name, pool] : pools) {
    for (const filters::CalibratedPool& each : calibrated) {
      if (each.dataset.empty() || each.dataset == name) pool.tau_high = each.calibration.thresholds.tau_high;
    }
    list.push_back(std::move(pool));
  }
  return quality_warnings(list, workspace.origins(), config.filter.tau_ceiling);
}

// Returns all candidates under an empty name, or the candidates of each dataset with pseudo labels under its
// name.
std::map<std::string, std::vector<Scored>> split_pool(std::vector<Scored> scored,
                                                      const config::BuildConfig& config) {
  std::map<std::string, std::vector<Scored>> pools;
  if (!config.calibrate.per_dataset) {
    pools[""] = std::move(scored);
    return pools;
  }
  for (const config::DatasetConfig& dataset : config.datasets) {
    if (dataset.role == config::Role::pseudo) pools[dataset.name];
  }
  for (const Scored& each : scored) pools[each.dataset->name].push_back(each);
  return pools;
}

}  // namespace

CalibrationSummary calibrate(const config::BuildConfig& config, const run::RunOptions& options) {
  config::require_keypoints(config);
  if (!config::needs_network(config)) {
    throw run::ConfigError(
        "no dataset of the config has the role \"pseudo\", so no label is predicted and there is nothing to "
        "calibrate: `build` needs no thresholds here");
  }
  const auto start = std::chrono::steady_clock::now();
  RankShare ranks(&config.network, options, "calibrate");
  config::BuildConfig own = config;
  own.network = ranks.own(config.network);
  ranks.await_digests();
  Workspace workspace(own, ranks.options(), ranks.leads() ? Workspace::Use::work : Workspace::Use::join);
  ranks.tell_digests();
  CalibrationSummary summary;
  summary.rank = ranks.rank();
  summary.candidates = static_cast<std::int64_t>(workspace.ingest().candidates.size());
  const std::vector<Scored> scored = predict_pool(own, workspace, ranks);
  if (!ranks.leads()) return summary;
  for (const auto& [dataset, candidates] : split_pool(scored, config)) {
    summary.pools.push_back(calibrate_pool(dataset, candidates, config, workspace));
  }
  summary.warnings = warnings_of(scored, summary.pools, config, workspace);
  for (const dataset::Warning& warning : summary.warnings) run::log_warning(warning.message);
  summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

std::string thresholds_layer(const CalibrationSummary& summary) {
  nlohmann::ordered_json filter = nlohmann::ordered_json::object();
  for (const filters::CalibratedPool& pool : summary.pools) {
    const filters::Thresholds& thresholds = pool.calibration.thresholds;
    nlohmann::ordered_json& place = pool.dataset.empty() ? filter : filter["datasets"][pool.dataset];
    place["tau_low"] = thresholds.tau_low;
    place["tau_high"] = thresholds.tau_high;
    place["delta"] = thresholds.delta;
  }
  return nlohmann::ordered_json{{"filter", filter}}.dump(2) + "\n";
}

void write_thresholds(const std::filesystem::path& path, const CalibrationSummary& summary) {
  if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path());
  manifests::write_file_atomically(path, thresholds_layer(summary));
}

}  // namespace q3d::pipeline::build
