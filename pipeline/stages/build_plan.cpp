#include "pipeline/stages/build_plan.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <utility>

#include "manifests/atomic_file.h"
#include "manifests/file_name.h"
#include "manifests/json_number.h"
#include "manifests/sealed_json.h"
#include "manifests/valid_utf8.h"
#include "pipeline/run/log.h"
#include "pipeline/stages/made_from.h"
#include "pipeline/stages/stage.h"

namespace q3d::pipeline::stages {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using nlohmann::ordered_json;

constexpr const char* kFormat = "quadruped3d-build-plan";
constexpr std::size_t kMembers = 7;  // members of the document without its digest

ordered_json stages_json(const BuildPlan& plan) {
  ordered_json stages = ordered_json::object();
  for (const Stage stage : kStages) {
    const std::string name(to_string(stage));
    const std::string& key = key_of(plan.keys, stage);
    if (key.empty()) continue;
    stages[name] = {{"key", key}, {"made_from", ordered_json::parse(plan.made_from.at(name))}};
  }
  return stages;
}

// The command's words may be paths of any bytes.
ordered_json command_json(const BuildPlan& plan) {
  ordered_json words = ordered_json::array();
  for (const std::string& word : plan.command) words.push_back(manifests::valid_utf8(word));
  return words;
}

std::string text_of(const BuildPlan& plan) {
  ordered_json units = ordered_json::array();
  for (const PlannedUnit& unit : plan.units) {
    units.push_back({{"input", unit.input_digest}, {"labels", unit.label_digest}});
  }
  const ordered_json document = {{"format", kFormat},
                                 {"name", plan.name},
                                 {"key", plan.keys.dataset},
                                 {"candidates", plan.candidates},
                                 {"command", command_json(plan)},
                                 {"stages", stages_json(plan)},
                                 {"units", units}};
  return manifests::seal_json(document);
}

// Checks a name or key, because these become parts of paths.
std::string name_in(const json& value) {
  auto name = value.get<std::string>();
  if (manifests::is_file_name(name)) return name;
  throw std::runtime_error(fmt::format("got {}, expected a name or a key", value.dump()));
}

// Reads a plan. Throws json::exception if a member is missing or has another type, and std::runtime_error for
// an impossible name or number.
BuildPlan plan_from(const json& document) {
  BuildPlan plan;
  plan.name = name_in(document.at("name"));
  plan.keys.dataset = name_in(document.at("key"));
  plan.candidates = manifests::whole_number_at(document, "candidates");
  plan.command = document.at("command").get<std::vector<std::string>>();
  for (const Stage stage : kStages) {
    const std::string name(to_string(stage));
    const auto found = document.at("stages").find(name);
    if (found == document.at("stages").end()) continue;
    key_of(plan.keys, stage) = name_in(found->at("key"));
    plan.made_from[name] = found->at("made_from").dump();
  }
  for (const json& unit : document.at("units")) {
    plan.units.push_back({unit.at("input").get<std::string>(), unit.at("labels").get<std::string>()});
  }
  return plan;
}

// A plan, or the problem with its file.
struct PlanFile {
  fs::path file;
  std::optional<BuildPlan> plan;
  std::string problem;
};

// Reads a plan. One of an earlier version has no digest.
PlanFile parse_plan(const fs::path& file, const manifests::SealedDocument& sealed) {
  const json document = sealed.document;
  if (document.value("format", json()) != kFormat) return {file, {}, "it holds no build plan"};
  if (!sealed.has_digest && document.size() != kMembers) {
    return {file, {}, fmt::format("got {} members, expected {} and a digest", document.size(), kMembers)};
  }
  try {
    return {file, plan_from(document), {}};
  } catch (const json::exception& error) {
    return {file, {}, error.what()};
  } catch (const std::runtime_error& error) {
    return {file, {}, error.what()};
  }
}

PlanFile read_plan(const fs::path& file) {
  try {
    return parse_plan(file, manifests::read_sealed_json(file));
  } catch (const manifests::DamagedDocument& error) {
    const std::string name = file.string() + ": ";  // the error begins with this prefix
    return {file, {}, std::string(error.what()).substr(name.size())};
  }
}

std::vector<PlanFile> read_plan_files(const fs::path& out) {
  std::vector<fs::path> files;
  if (fs::exists(plans_folder(out))) {
    for (const auto& entry : fs::directory_iterator(plans_folder(out))) {
      if (entry.path().extension() == ".json") files.push_back(entry.path());
    }
  }
  std::sort(files.begin(), files.end());
  std::vector<PlanFile> plans;
  plans.reserve(files.size());
  for (const fs::path& file : files) plans.push_back(read_plan(file));
  return plans;
}

}  // namespace

fs::path plans_folder(const fs::path& out) {
  return out / "stages" / "builds";
}

std::string version_name(const std::string& name, const StageKeys& keys) {
  return name + "-" + keys.dataset.substr(0, kShortKey);
}

BuildPlan plan_of(const config::BuildConfig& config, const config::JudgingRules& rules,
                  const candidates::Ingest& ingest, const AssetDigests& assets, const std::string& device_key,
                  std::vector<std::string> command) {
  BuildPlan plan;
  plan.name = config.name;
  plan.candidates = static_cast<std::int64_t>(ingest.candidates.size());
  plan.keys = stage_keys(config, rules, ingest, assets, device_key);
  plan.made_from = made_from(config, rules, ingest, assets, device_key);
  plan.command = std::move(command);
  for (const candidates::Unit& unit : ingest.units) {
    plan.units.push_back({unit.input_digest, unit.label_digest});
  }
  return plan;
}

fs::path plan_file(const fs::path& out, const std::string& version) {
  return plans_folder(out) / (version + ".json");
}

void write_build_plan(const fs::path& out, const BuildPlan& plan) {
  const fs::path file = plan_file(out, version_name(plan.name, plan.keys));
  const std::string text = text_of(plan);
  if (fs::exists(file) && manifests::read_file(file) == text) return;
  fs::create_directories(file.parent_path());
  manifests::remove_temporaries(file.parent_path());
  manifests::write_file_atomically(file, text);
}

std::vector<BuildPlan> read_build_plans(const fs::path& out) {
  std::vector<BuildPlan> plans;
  for (PlanFile& each : read_plan_files(out)) {
    if (each.plan) {
      plans.push_back(std::move(*each.plan));
    } else {
      run::log_warning(fmt::format("{}: damaged: {}; the next run of its build writes it anew",
                                   each.file.string(), each.problem));
    }
  }
  return plans;
}

std::vector<DamagedPlan> find_damaged_plans(const fs::path& out) {
  std::vector<DamagedPlan> damaged;
  for (PlanFile& each : read_plan_files(out)) {
    if (!each.plan) damaged.push_back({std::move(each.file), std::move(each.problem)});
  }
  return damaged;
}

}  // namespace q3d::pipeline::stages
