// A plan says what a build will make: its units and the keys of its stages.
//
// A build writes its plan as soon as the candidates are read, to <out>/stages/builds/<name>-<key>.json.
// `status` uses it to show how far the build has come, and `build --dry-run` to say why a later build makes a
// stage anew. No result depends on a plan, and it is no part of a dataset.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "pipeline/candidates/ingest.h"
#include "pipeline/stages/stages.h"

namespace q3d::pipeline::stages {

// The digests of a unit, as candidates::Unit has them.
struct PlannedUnit {
  std::string input_digest;
  std::string label_digest;
};

struct BuildPlan {
  std::string name;  // of the dataset
  std::int64_t candidates = 0;
  std::vector<PlannedUnit> units;
  StageKeys keys;
  std::map<std::string, std::string> made_from;  // the texts of made_from.h
  std::vector<std::string>
      command;  // the words after the program's name, as the user gave them; may be empty
};

// Returns the name of a version's folder: "<name>-<first 12 hex digits of the dataset's key>".
std::string version_name(const std::string& name, const StageKeys& keys);

BuildPlan plan_of(const config::BuildConfig& config, const config::JudgingRules& rules,
                  const candidates::Ingest& ingest, const AssetDigests& assets, const std::string& device_key,
                  std::vector<std::string> command);

// Returns the folder of the plans. The other folders beside it belong to stages.
std::filesystem::path plans_folder(const std::filesystem::path& out);

// Returns the path of a version's plan.
std::filesystem::path plan_file(const std::filesystem::path& out, const std::string& version);

// Writes the plan, unless the file already holds it. Throws manifests::IoError.
void write_build_plan(const std::filesystem::path& out, const BuildPlan& plan);

// Returns all plans in an output folder, sorted by file name. A file that holds no plan is left out, and a
// warning names it. Throws manifests::IoError.
std::vector<BuildPlan> read_build_plans(const std::filesystem::path& out);

struct DamagedPlan {
  std::filesystem::path file;
  std::string problem;  // what was found and what was expected
};

// Returns the files that read_build_plans() would leave out. Throws manifests::IoError.
std::vector<DamagedPlan> find_damaged_plans(const std::filesystem::path& out);

}  // namespace q3d::pipeline::stages
