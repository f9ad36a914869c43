// Reads an output folder: its builds, finished or not, and how far their stages have come.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/dataset/export_list.h"
#include "pipeline/stages/build_plan.h"
#include "pipeline/stages/stage.h"

namespace q3d::pipeline::status {

// The state of a stage of one build. Units are identified by their input, so a unit that was made from other
// pictures or labels counts as missing. Files are compared by their sizes; `verify` and the next build read
// them whole.
struct StageStatus {
  stages::Stage stage = stages::Stage::ingest;
  std::string key;                    // 64 hex digits; empty if dataset.json does not state it
  std::filesystem::path manifest;     // relative to the output folder; empty if the stage has none
  bool has_manifest = false;          // whether the manifest exists
  std::int64_t finished = 0;          // units
  std::vector<std::int64_t> missing;  // units that are still to be made, ascending
  std::vector<std::int64_t> damaged;  // missing units whose file is gone or has another size
  std::int64_t not_needed = 0;        // units without stored crops that have their shard
};

// A file or folder that comes after the stages.
struct ResultStatus {
  std::filesystem::path manifest;  // relative to the output folder
  bool is_there = false;
};

struct BuildStatus {
  std::string version;  // "<name>-<first 12 hex digits of the key>", the name of its folder
  std::string key;
  bool is_latest = false;
  bool has_plan = false;    // without one, units are counted by the journals alone, whatever their input was
  bool is_derived = false;  // made by `merge` or `subset`, so it has no stages
  std::int64_t candidates = 0;
  std::int64_t units = 0;
  std::vector<StageStatus> stages;   // in the order in which they are made; those that the build has
  ResultStatus dataset;              // <version>/dataset.json
  ResultStatus report;               // report/<version>/manifest.json
  std::vector<std::string> command;  // the command that continues it, as it was typed; may be empty
};

// A folder of a stage that no build refers to, such as the predictions of `calibrate`.
struct OtherStage {
  std::filesystem::path folder;  // relative to the output folder
  std::int64_t units = 0;        // units that its journal names
};

struct FolderStatus {
  std::filesystem::path out;
  std::vector<BuildStatus> builds;             // in the order of their versions
  std::vector<OtherStage> others;              // in the order of their folders
  std::vector<dataset::ExportStatus> exports;  // of all builds in the folder
};

// Returns the status of one build whose plan is known, whether or not the plan has been written.
BuildStatus build_status(const std::filesystem::path& out, const stages::BuildPlan& plan);

// Reads the plans, the journals and every dataset.json below `out`, and changes nothing; a build may be
// running in the folder. Throws std::runtime_error if `out` holds no stages and no dataset, or if a
// dataset.json is damaged, and manifests::IoError.
FolderStatus folder_status(const std::filesystem::path& out);

}  // namespace q3d::pipeline::status
