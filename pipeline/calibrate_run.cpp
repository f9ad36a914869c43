#include "pipeline/calibrate_run.h"

#include <tbb/parallel_for.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "manifests/atomic_file.h"
#include "pipeline/errors.h"
#include "pipeline/interrupt.h"
#include "pipeline/progress.h"
#include "pipeline/stage_store.h"
#include "pipeline/unit_flow.h"
#include "pipeline/unit_steps.h"
#include "pipeline/unit_tables.h"
#include "pipeline/workspace.h"

namespace q3d::pipeline {
namespace {

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

// L_proj of every candidate's prediction; NaN for the excluded, the failed and for those that are not
// predicted. What an earlier run predicted is not predicted again.
std::vector<double> initial_errors(const BuildConfig& config, Workspace& workspace) {
  const Ingest& ingest = workspace.ingest();
  StageStore predictions(workspace.out(), "predict",
                         predict_key(config, workspace.assets(), workspace.device_key()));
  std::vector<double> errors(ingest.candidates.size());
  Progress progress("predicted", static_cast<std::int64_t>(ingest.candidates.size()), workspace.quiet());
  UnitFlow flow;
  flow.units = static_cast<std::int64_t>(ingest.units.size());
  flow.read = [&](std::int64_t index) {
    auto work = std::make_shared<UnitWork>();
    work->unit = &ingest.units[static_cast<std::size_t>(index)];
    work->candidates = std::span(ingest.candidates).subspan(work->unit->first, work->unit->count);
    if (const auto table = predictions.load(*work->unit)) work->predicted = predicted_from_table(*table);
    work->predicted_before = work->predicted.has_value();
    return work;
  };
  flow.decode = [&](UnitWork& work) { decode_unit(work, config.shards, nullptr); };
  flow.compute = [&](UnitWork& work) {
    if (!work.predicted) predict_unit(work, [&]() -> Network& { return workspace.network(); });
  };
  flow.write = [&](UnitWork& work) {
    if (!work.predicted_before) predictions.save(*work.unit, to_table(work.candidates, *work.predicted));
    for (std::size_t i = 0; i < work.candidates.size(); ++i) {
      const bool is_left_out = work.candidates[i].exclusion.reason != manifests::Reason::none;
      errors[work.unit->first + i] = is_left_out ? std::numeric_limits<double>::quiet_NaN()
                                                 : initial_error(work.candidates[i], (*work.predicted)[i]);
    }
    progress.advance(static_cast<std::int64_t>(work.unit->count), work.predicted_before);
  };
  run(flow, workspace.device());
  return errors;
}

// Adapts some candidates and says which of them the fidelity rule would keep.
std::vector<bool> adapt_some(const std::vector<const Candidate*>& candidates,
                             const filters::Thresholds& limits, const ShardConfig& shards,
                             Workspace& workspace) {
  std::vector<std::vector<std::uint8_t>> patches(candidates.size());
  tbb::parallel_for(std::size_t{0}, candidates.size(), [&](std::size_t i) {
    patches[i] = decode_sample(candidates[i]->record, {.patch = true, .stored_crop = false}, shards).patch;
  });
  std::vector<AdaptRequest> requests;
  std::vector<std::size_t> positions;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (patches[i].empty()) continue;
    AdaptRequest& request = requests.emplace_back();
    request.patch = patches[i];
    request.keypoints = crop_keypoints(candidates[i]->record);
    request.iterations = limits.gain_window;
    request.stop_below = limits.tau_low;
    positions.push_back(i);
  }
  std::vector<AdaptOutcome> outcomes;
  workspace.device().run([&] { outcomes = workspace.network().adapt(requests); });
  std::vector<bool> passes(candidates.size(), false);
  for (std::size_t j = 0; j < outcomes.size(); ++j) {
    passes[positions[j]] =
        filters::judge_adapted(outcomes[j].curve, limits).verdict == manifests::Verdict::refined;
  }
  return passes;
}

// Adapts candidates from tau_low upwards, a chunk at a time, until enough have passed. Those further out keep
// `passes_adaptation`: they lie beyond tau_high whatever they would do.
std::int64_t adapt_until_enough(std::vector<filters::CalibrationSample>& pool,
                                const std::vector<const Candidate*>& candidates,
                                const filters::Thresholds& limits, const BuildConfig& config,
                                Workspace& workspace) {
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
  Progress progress("adapted", static_cast<std::int64_t>(order.size()), workspace.quiet());
  std::int64_t passed = 0;
  std::size_t done = 0;
  while (done < order.size() && passed < needed) {
    throw_if_interrupted();
    const std::size_t count = std::min(chunk, order.size() - done);
    std::vector<const Candidate*> some;
    for (std::size_t i = 0; i < count; ++i) some.push_back(candidates[order[done + i]]);
    const std::vector<bool> passes = adapt_some(some, limits, config.shards, workspace);
    for (std::size_t i = 0; i < count; ++i) {
      pool[order[done + i]].passes_adaptation = passes[i];
      passed += passes[i] ? 1 : 0;
    }
    done += count;
    progress.advance(static_cast<std::int64_t>(count));
  }
  return static_cast<std::int64_t>(done);
}

}  // namespace

CalibrationSummary calibrate(const BuildConfig& config, const RunOptions& options) {
  if (!needs_network(config)) {
    throw ConfigError(
        "no dataset of the config has the role \"pseudo\", so no label is predicted and there is nothing to "
        "calibrate: `build` needs no thresholds here");
  }
  const auto start = std::chrono::steady_clock::now();
  Workspace workspace(config, options);
  const std::vector<double> errors = initial_errors(config, workspace);
  std::vector<filters::CalibrationSample> pool;
  std::vector<const Candidate*> candidates;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (std::isnan(errors[i])) continue;
    pool.push_back({errors[i], true});
    candidates.push_back(&workspace.ingest().candidates[i]);
  }
  if (pool.empty()) {
    throw std::runtime_error(
        "no candidate could be predicted, so there is nothing to calibrate on; `build` with any "
        "thresholds lists why in verdicts.csv");
  }
  filters::Thresholds base;
  base.delta = config.filter.delta;
  // tau_low is a quantile of the errors alone; what passes adaptation decides tau_high.
  filters::Thresholds limits = filters::calibrate(pool, config.calibrate, base).thresholds;
  limits.tau_high = kNoLimit;
  CalibrationSummary summary;
  summary.adapted = adapt_until_enough(pool, candidates, limits, config, workspace);
  summary.calibration = filters::calibrate(pool, config.calibrate, base);
  summary.candidates = static_cast<std::int64_t>(errors.size());
  summary.judged = static_cast<std::int64_t>(pool.size());
  summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

void write_thresholds(const std::filesystem::path& path, const filters::Thresholds& thresholds) {
  const nlohmann::ordered_json document = {
      {"filter",
       {{"tau_low", thresholds.tau_low}, {"tau_high", thresholds.tau_high}, {"delta", thresholds.delta}}}};
  if (path.has_parent_path()) std::filesystem::create_directories(path.parent_path());
  manifests::write_file_atomically(path, document.dump(2) + "\n");
}

}  // namespace q3d::pipeline
