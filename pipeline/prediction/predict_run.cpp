#include "pipeline/prediction/predict_run.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <utility>

#include "manifests/digest.h"
#include "pipeline/build/prediction_progress.h"
#include "pipeline/build/workspace.h"
#include "pipeline/config/build_settings.h"
#include "pipeline/run/errors.h"
#include "pipeline/run/progress.h"
#include "pipeline/stages/stage_store.h"
#include "pipeline/unit/crop_keypoints.h"
#include "pipeline/unit/decode.h"
#include "pipeline/unit/predict.h"
#include "pipeline/unit/unit_flow.h"
#include "pipeline/unit/unit_tables.h"

namespace q3d::pipeline::prediction {
namespace {

using manifests::Reason;

// Raise this number when a change of the code changes the result of adaptation without a verdict.
constexpr int kAdaptCode = 1;

std::string adapt_key(const config::BuildConfig& config, const std::string& predict_key, int iterations) {
  nlohmann::json parts = config::key_parts(config::tta_settings(), config.tta, config::DecidedStage::refine);
  parts.update(
      {{"stage", "adapt"}, {"code", kAdaptCode}, {"predict", predict_key}, {"iterations", iterations}});
  return manifests::sha256(parts.dump());
}

void require_network(const config::BuildConfig& config) {
  for (const config::DatasetConfig& dataset : config.datasets) {
    if (dataset.role == config::Role::pseudo) continue;
    throw run::ConfigError(
        fmt::format("the dataset \"{}\" has the role \"{}\", but `predict` asks the network "
                    "for every body; leave the role out",
                    dataset.name, to_string(dataset.role)));
  }
}

// Takes every unit through prediction and, if requested, adaptation.
class Predictor {
 public:
  Predictor(const config::BuildConfig& config, const PredictOptions& options, build::Workspace& workspace)
      : config_(config),
        options_(options),
        workspace_(workspace),
        key_(stages::predict_key(config, workspace.assets(), workspace.device_key())),
        predictions_(workspace.out(), "predict", key_),
        progress_("animals", static_cast<std::int64_t>(workspace.ingest().candidates.size()),
                  workspace.quiet()) {
    if (options.iterations > 0) {
      adaptations_ = std::make_unique<stages::StageStore>(workspace.out(), "adapt",
                                                          adapt_key(config, key_, options.iterations));
    }
  }

  std::vector<PredictedAnimal> run() {
    unit::UnitFlow flow;
    flow.units = static_cast<std::int64_t>(workspace_.ingest().units.size());
    flow.read = [this](std::int64_t index) { return read(index); };
    flow.decode = [this](unit::UnitWork& work) { decode(work); };
    flow.compute = [this](unit::UnitWork& work) { compute(work); };
    flow.write = [this](unit::UnitWork& work) { write(work); };
    unit::run_units(flow, workspace_.device());
    return std::move(animals_);
  }

 private:
  std::shared_ptr<unit::UnitWork> read(std::int64_t index) {
    const std::shared_ptr<unit::UnitWork> work = unit::open_unit(workspace_.ingest(), index);
    if (const auto table = predictions_.load(*work->unit)) {
      unit::set_predictions(*work, unit::predicted_from_table(*table));
    }
    if (adaptations_) {
      if (const auto table = adaptations_->load(*work->unit))
        work->refined = unit::refined_from_table(*table);
    }
    work->predicted_before = work->predicted.has_value();
    work->refined_before = work->refined.has_value();
    return work;
  }

  // Decodes the pictures from which something remains to be computed.
  void decode(unit::UnitWork& work) const {
    const bool is_done = work.predicted && (!adaptations_ || work.refined);
    if (is_done) return;
    if (!work.predicted) {
      unit::decode_unit(work, config_.shards, nullptr);
      return;
    }
    work.decoded.assign(work.candidates.size(), {});
    for (std::size_t i = 0; i < work.candidates.size(); ++i) {
      if (!adapts(work, i)) continue;
      work.decoded[i] = unit::decode_sample(work.candidates[i], {.patch = true}, config_.shards);
    }
  }

  static bool adapts(const unit::UnitWork& work, std::size_t i) {
    return !std::isnan(work.errors[i]) && unit::visible_keypoints(work.keypoints[i]) > 0;
  }

  void compute(unit::UnitWork& work) {
    if (!work.predicted) {
      unit::predict_unit(
          work, [this]() -> device::Network& { return workspace_.network(); },
          {adaptations_ ? nullptr : &predicted_, static_cast<std::size_t>(config_.network.batch)});
      if (!adaptations_) predicted_.tell();
    }
    if (adaptations_ && !work.refined) work.refined = adapt(work);
  }

  std::vector<unit::RefinedSample> adapt(const unit::UnitWork& work) {
    std::vector<device::AdaptRequest> requests;
    std::vector<unit::RefinedSample> samples;
    for (std::size_t i = 0; i < work.candidates.size(); ++i) {
      if (!adapts(work, i)) continue;
      device::AdaptRequest& request = requests.emplace_back();
      request.patch = work.decoded[i].patch;
      request.keypoints = work.keypoints[i];
      request.schedule.iterations = options_.iterations;
      samples.emplace_back().sample = i;
    }
    if (requests.empty()) return samples;
    std::vector<device::AdaptOutcome> outcomes =
        workspace_.network().adapt(requests, {}, [this, told = std::size_t{0}](std::size_t ended) mutable {
          progress_.advance(static_cast<std::int64_t>(ended - std::exchange(told, ended)));
        });
    for (std::size_t j = 0; j < outcomes.size(); ++j) {
      samples[j].curve = std::move(outcomes[j].curve);
      samples[j].body = outcomes[j].best;
    }
    return samples;
  }

  // Returns how many of a unit's animals were adapted.
  static std::int64_t adapted(const unit::UnitWork& work) {
    return static_cast<std::int64_t>(work.refined ? work.refined->size() : 0);
  }

  void write(unit::UnitWork& work) {
    if (!work.predicted_before) {
      predictions_.save(*work.unit, unit::to_table(work.candidates, *work.predicted));
    }
    if (adaptations_ && !work.refined_before) adaptations_->save(*work.unit, unit::to_table(*work.refined));
    const std::size_t first = animals_.size();
    for (std::size_t i = 0; i < work.candidates.size(); ++i) {
      const unit::PredictedSample& sample = (*work.predicted)[i];
      PredictedAnimal& animal = animals_.emplace_back();
      animal.record = work.candidates[i].record;
      animal.failure = sample.failure;
      animal.detail = sample.detail;
      animal.image_width_px = sample.image_width_px;
      animal.image_height_px = sample.image_height_px;
      animal.body = sample.body;
    }
    if (work.refined) {
      for (const unit::RefinedSample& refined : *work.refined)
        take(refined, animals_[first + refined.sample]);
    }
    count_the_rest(work);
  }

  // Counts the animals of a finished unit that were not counted before. Adaptation takes most of the time, so
  // an animal counts when it is adapted, and the others when their unit is finished.
  void count_the_rest(const unit::UnitWork& work) {
    const auto all = static_cast<std::int64_t>(work.unit->count);
    if (!adaptations_) {
      if (work.predicted_before) progress_.advance(all, /*from_earlier_run=*/true);
      return;
    }
    const bool is_old = work.predicted_before && work.refined_before;
    progress_.advance(work.refined_before ? all : all - adapted(work), is_old);
  }

  static void take(const unit::RefinedSample& refined, PredictedAnimal& animal) {
    animal.body = refined.body;
    animal.curve = refined.curve;
    animal.best_iteration = static_cast<int>(std::min_element(refined.curve.begin(), refined.curve.end()) -
                                             refined.curve.begin());
  }

  const config::BuildConfig& config_;
  const PredictOptions& options_;
  build::Workspace& workspace_;
  std::string key_;
  stages::StageStore predictions_;
  std::unique_ptr<stages::StageStore> adaptations_;  // null without adaptation
  run::Progress progress_;
  build::PredictionProgress predicted_{progress_};
  std::vector<PredictedAnimal> animals_;
};

}  // namespace

PredictionSummary predict(const config::BuildConfig& config, const PredictOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  require_network(config);
  build::Workspace workspace(config, options.run);
  PredictionSummary summary;
  summary.animals = Predictor(config, options, workspace).run();
  for (const candidates::IngestNote& note : workspace.ingest().notes) summary.notes.push_back(note.line());
  summary.checkpoint_sha256 = workspace.assets().checkpoint;
  summary.smal_asset_sha256 = workspace.assets().smal_asset;
  for (const PredictedAnimal& animal : summary.animals) {
    if (animal.failure != Reason::none) ++summary.failed;
    if (!animal.curve.empty()) ++summary.adapted;
  }
  summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

}  // namespace q3d::pipeline::prediction
