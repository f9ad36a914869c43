#include "pipeline/build/dry_run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "pipeline/build/publish.h"
#include "pipeline/build/quality.h"
#include "pipeline/build/workspace.h"
#include "pipeline/dataset/is_published.h"
#include "pipeline/run/words.h"
#include "pipeline/stages/build_plan.h"
#include "pipeline/stages/plan_difference.h"
#include "pipeline/stages/stage_view.h"

namespace q3d::pipeline::build {
namespace {

namespace fs = std::filesystem;
using stages::Stage;
using stages::UnitState;

class Forecaster {
 public:
  Forecaster(const fs::path& out, const candidates::Ingest& ingest, const stages::BuildPlan& plan)
      : out_(out), ingest_(ingest), plan_(plan), plans_(stages::read_build_plans(out)) {
    std::error_code error;
    latest_ = fs::read_symlink(out / "latest", error).string();
  }

  std::vector<StageForecast> all() const {
    const std::vector<UnitState> shards = states(Stage::shards);
    std::vector<StageForecast> list;
    for (const Stage stage : stages::kStages) {
      if (!stages::has_folder(stage) || key_of(plan_.keys, stage).empty()) continue;
      list.push_back(forecast(stage, stage == Stage::shards ? shards : states(stage)));
      if (stage == Stage::crops) excuse_crops(states(stage), shards, list.back());
    }
    return list;
  }

 private:
  stages::StageView view(Stage stage) const {
    return {out_, std::string(to_string(stage)), key_of(plan_.keys, stage)};
  }

  // Returns the state of every unit's file, in the order of the units.
  std::vector<UnitState> states(Stage stage) const {
    const stages::StageView folder = view(stage);
    std::vector<UnitState> found;
    for (const candidates::Unit& unit : ingest_.units) {
      const std::string& digest = stages::depends_on_labels(stage) ? unit.label_digest : unit.input_digest;
      found.push_back(folder.state(unit.index, digest, stages::Comparison::bytes));
    }
    return found;
  }

  StageForecast forecast(Stage stage, const std::vector<UnitState>& units) const {
    const stages::StageView folder = view(stage);
    const auto count = [&](UnitState state) { return std::count(units.begin(), units.end(), state); };
    StageForecast result;
    result.stage = stage;
    result.key = key_of(plan_.keys, stage);
    result.folder = fs::relative(folder.folder(), out_);
    result.reused = count(UnitState::finished);
    result.made = static_cast<std::int64_t>(units.size()) - result.reused;
    if (result.made == 0) return result;
    if (!folder.exists()) {
      result.why.push_back(why_new(stage));
      return result;
    }
    const auto add = [&](UnitState state, std::string_view what) {
      if (count(state) > 0)
        result.why.push_back(fmt::format("{} {}", run::counted(count(state), "unit"), what));
    };
    add(UnitState::absent, "not made so far");
    add(UnitState::other_input, "with other pictures, labels or exclusions than before");
    add(UnitState::damaged, "whose file is gone or damaged");
    return result;
  }

  // Clears the need for a table of stored crops of units that have their shard.
  static void excuse_crops(const std::vector<UnitState>& crops, const std::vector<UnitState>& shards,
                           StageForecast& result) {
    for (std::size_t i = 0; i < crops.size(); ++i) {
      if (crops[i] != UnitState::finished && shards[i] == UnitState::finished) ++result.not_needed;
    }
    result.made -= result.not_needed;
    if (result.made == 0) result.why.clear();
  }

  // Says why the stage's key is new.
  std::string why_new(Stage stage) const {
    const auto nearest = stages::nearest_plan(plans_, plan_, stage, latest_);
    if (!nearest) return "no build in this folder has made the stage";
    const std::vector<std::string> changes = stages::differences(*nearest, plan_, stage);
    const std::string version = stages::version_name(nearest->name, nearest->keys);
    if (changes.empty()) return fmt::format("its folder is not there, although {} has the same", version);
    return fmt::format("its key differs from that of {}: {}", version, fmt::join(changes, "; "));
  }

  const fs::path& out_;
  const candidates::Ingest& ingest_;
  const stages::BuildPlan& plan_;
  std::vector<stages::BuildPlan> plans_;
  std::string latest_;  // name of the newest version's folder; empty if there is none
};

}  // namespace

DryRun dry_run(const config::BuildConfig& config, const run::RunOptions& options) {
  const config::JudgingRules rules = checked_rules(config, options.above_ceiling);
  Workspace workspace(config, options, Workspace::Use::look);
  const stages::BuildPlan plan = stages::plan_of(config, rules, workspace.ingest(), workspace.assets(),
                                                 workspace.device_key(), /*command=*/{});
  DryRun result;
  result.version = stages::version_name(config.name, plan.keys);
  result.candidates = plan.candidates;
  result.units = static_cast<std::int64_t>(plan.units.size());
  result.is_up_to_date = dataset::is_published(options.out / result.version, plan.keys.dataset);
  result.stages = Forecaster(options.out, workspace.ingest(), plan).all();
  return result;
}

}  // namespace q3d::pipeline::build
