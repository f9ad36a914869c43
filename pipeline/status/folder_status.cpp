#include "pipeline/status/folder_status.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <system_error>

#include "pipeline/dataset/dataset_manifest.h"
#include "pipeline/stages/stage_view.h"
#include "pipeline/stages/stages.h"

namespace q3d::pipeline::status {
namespace {

namespace fs = std::filesystem;
using stages::Stage;
using stages::UnitState;

// The digests of a build's units if its plan is known; otherwise only their number.
struct Units {
  std::int64_t count = 0;
  const std::vector<stages::PlannedUnit>* planned = nullptr;

  std::optional<std::string> digest(std::int64_t unit, Stage stage) const {
    if (planned == nullptr) return std::nullopt;
    const stages::PlannedUnit& found = planned->at(static_cast<std::size_t>(unit));
    return stages::depends_on_labels(stage) ? found.label_digest : found.input_digest;
  }
};

// Returns the state of the units of one stage that has a folder.
StageStatus folder_stage(const fs::path& out, Stage stage, const std::string& key, const Units& units) {
  const stages::StageView view(out, std::string(to_string(stage)), key);
  StageStatus status;
  status.stage = stage;
  status.key = key;
  status.manifest = fs::relative(view.manifest(), out);
  status.has_manifest = view.exists();
  for (std::int64_t unit = 0; unit < units.count; ++unit) {
    const UnitState state = view.state(unit, units.digest(unit, stage), stages::Comparison::sizes);
    if (state == UnitState::finished) {
      ++status.finished;
      continue;
    }
    status.missing.push_back(unit);
    if (state == UnitState::damaged) status.damaged.push_back(unit);
  }
  return status;
}

// Counts units without a table of stored crops as not needed if they have their shard, which holds the crops.
void excuse_crops(StageStatus& crops, const StageStatus& shards) {
  const auto has_shard = [&](std::int64_t unit) {
    return !std::binary_search(shards.missing.begin(), shards.missing.end(), unit);
  };
  const auto count = static_cast<std::int64_t>(crops.missing.size());
  std::erase_if(crops.missing, has_shard);
  std::erase_if(crops.damaged, has_shard);
  crops.not_needed = count - static_cast<std::int64_t>(crops.missing.size());
}

std::vector<StageStatus> stages_of(const fs::path& out, const stages::StageKeys& keys, const Units& units,
                                   const fs::path& plan) {
  std::vector<StageStatus> list;
  for (const Stage stage : stages::kStages) {
    const std::string& key = key_of(keys, stage);
    if (key.empty()) continue;
    if (stages::has_folder(stage)) {
      list.push_back(folder_stage(out, stage, key, units));
      continue;
    }
    StageStatus& status = list.emplace_back();
    status.stage = stage;
    status.key = key;
    if (stage != Stage::ingest) continue;
    status.manifest = fs::relative(plan, out);
    status.has_manifest = fs::exists(plan);
    status.finished = units.count;
  }
  const auto crops = std::find_if(list.begin(), list.end(),
                                  [](const StageStatus& each) { return each.stage == Stage::crops; });
  if (crops != list.end()) excuse_crops(*crops, list.back());
  return list;
}

void find_results(const fs::path& out, BuildStatus& build) {
  build.dataset.manifest = fs::path(build.version) / "dataset.json";
  build.report.manifest = fs::path("report") / build.version / "manifest.json";
  for (ResultStatus* result : {&build.dataset, &build.report}) {
    result->is_there = fs::exists(out / result->manifest);
  }
  std::error_code error;
  build.is_latest = fs::read_symlink(out / "latest", error) == build.version;
}

// Returns the status of a version without a plan, which was built before plans existed or was made from other
// versions.
BuildStatus published_status(const fs::path& out, const std::string& version) {
  const dataset::DatasetManifest manifest = dataset::read_dataset_manifest(out / version);
  BuildStatus build;
  build.version = version;
  build.key = manifest.key;
  build.is_derived = manifest.keys.predict.empty();
  build.candidates = manifest.counts.candidates;
  build.units = static_cast<std::int64_t>(manifest.shards.size());
  if (!build.is_derived) {
    build.stages = stages_of(out, manifest.keys, {build.units, nullptr}, stages::plan_file(out, version));
  }
  find_results(out, build);
  return build;
}

std::map<std::string, BuildStatus> builds_in(const fs::path& out) {
  std::map<std::string, BuildStatus> builds;
  for (const stages::BuildPlan& plan : stages::read_build_plans(out)) {
    BuildStatus build = build_status(out, plan);
    builds.emplace(build.version, std::move(build));
  }
  for (const auto& entry : fs::directory_iterator(out)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_symlink() || builds.contains(name) || !fs::exists(entry.path() / "dataset.json")) continue;
    builds.emplace(name, published_status(out, name));
  }
  return builds;
}

std::vector<OtherStage> others_in(const fs::path& out, const std::map<std::string, BuildStatus>& builds) {
  std::set<fs::path> known;
  for (const auto& [version, build] : builds) {
    for (const StageStatus& stage : build.stages) known.insert(stage.manifest.parent_path());
  }
  std::vector<OtherStage> others;
  if (!fs::exists(out / "stages")) return others;
  for (const auto& entry : fs::directory_iterator(out / "stages")) {
    fs::path folder = fs::relative(entry.path(), out);
    if (known.contains(folder) || !fs::exists(entry.path() / "manifest.json")) continue;
    const manifests::Journal journal(entry.path() / "journal.jsonl");
    others.push_back({std::move(folder), static_cast<std::int64_t>(journal.entries().size())});
  }
  std::sort(others.begin(), others.end(),
            [](const OtherStage& a, const OtherStage& b) { return a.folder < b.folder; });
  return others;
}

}  // namespace

BuildStatus build_status(const fs::path& out, const stages::BuildPlan& plan) {
  BuildStatus build;
  build.version = stages::version_name(plan.name, plan.keys);
  build.key = plan.keys.dataset;
  build.has_plan = true;
  build.candidates = plan.candidates;
  build.units = static_cast<std::int64_t>(plan.units.size());
  build.stages = stages_of(out, plan.keys, {build.units, &plan.units}, stages::plan_file(out, build.version));
  build.command = plan.command;
  find_results(out, build);
  return build;
}

FolderStatus folder_status(const fs::path& out) {
  FolderStatus status;
  status.out = out;
  std::map<std::string, BuildStatus> builds = builds_in(out);
  status.others = others_in(out, builds);
  status.exports = dataset::listed_exports(out);
  for (auto& [version, build] : builds) status.builds.push_back(std::move(build));
  if (status.builds.empty() && status.others.empty()) {
    throw std::runtime_error(
        fmt::format("{}: expected an output folder of `build`, with its stages or a dataset, and found "
                    "neither",
                    out.string()));
  }
  return status;
}

}  // namespace q3d::pipeline::status
