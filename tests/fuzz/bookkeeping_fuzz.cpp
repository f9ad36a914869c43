// The files in which the program notes what lies in an output folder. The first byte of an input says which:
// p the plan of a build, m the manifest of a stage, l the list of exports, e the manifest of an export, w the
// description of a rendered world.
#include <nlohmann/json.hpp>

#include "manifests/durability.h"
#include "manifests/json_parse.h"
#include "manifests/sealed_json.h"
#include "pipeline/candidates/ingest.h"
#include "pipeline/dataset/export_list.h"
#include "pipeline/exports/export_folder.h"
#include "pipeline/run/errors.h"
#include "pipeline/stages/build_plan.h"
#include "pipeline/stages/stage.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

using q3d::fuzz::require;
using q3d::fuzz::Scratch;
namespace stages = q3d::pipeline::stages;

void read_plan(const Scratch& scratch, std::string_view bytes) {
  scratch.write("stages/builds/plan.json", bytes);
  const auto plans = stages::read_build_plans(scratch.root());
  for (const auto& plan : plans) {
    for (const auto stage : stages::kStages) {
      const std::string& key = key_of(plan.keys, stage);
      require(key.find('/') == key.npos, "a stage's key can be a part of a folder's name", key);
    }
    require(plan.name.find('/') == plan.name.npos && plan.candidates >= 0, "a plan is of one dataset",
            plan.name);
    const Scratch& other = scratch;
    const auto out = other.root() / "again";
    std::filesystem::remove_all(out);
    stages::write_build_plan(out, plan);
    const auto again = stages::read_build_plans(out);
    require(again.size() == 1 && again.front().made_from == plan.made_from &&
                again.front().units.size() == plan.units.size() &&
                again.front().keys.dataset == plan.keys.dataset,
            "a plan survives being written", plan.name);
  }
}

void read_stage_manifest(const Scratch& scratch, std::string_view bytes) {
  const auto key = stages::key_in_manifest(scratch.write("manifest.json", bytes));
  require(!key || (key->size() == 64 && key->find('/') == key->npos), "a stage's key is a digest");
}

void read_list(const Scratch& scratch, std::string_view bytes) {
  const auto [entry, manifest] = q3d::fuzz::two_files(bytes);
  scratch.write("stages/exports/coco-1.json", entry);
  scratch.write("coco/export.json", manifest);
  for (const auto& status : q3d::pipeline::dataset::listed_exports(scratch.root())) {
    require(status.key.empty() || status.key.size() == 64, "an export has a key");
  }
}

void read_export(const Scratch& scratch, std::string_view bytes) {
  const auto file = scratch.write("export/export.json", bytes);
  try {
    const q3d::pipeline::exports::ExportFolder folder(file.parent_path(), {{"export", "coco"}, {"key", "k"}});
    require(folder.is_complete(), "a folder with a manifest is complete");
    const nlohmann::ordered_json& manifest = folder.manifest();
    require(manifest.at("files").is_array() && manifest.at("picture_files").is_array(),
            "an export lists its files");
  } catch (const q3d::pipeline::run::ConfigError& error) {
    require(std::string_view(error.what()).find("export.json") != std::string_view::npos,
            "a refusal names the file", error.what());
  } catch (const std::runtime_error& error) {
    require(std::string_view(error.what()).find("export") != std::string_view::npos,
            "a refusal names the file", error.what());
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  q3d::manifests::set_durability({.syncs = false, .locks = true});  // syncs would take most of the time
  static const Scratch scratch;
  const auto [reader, bytes] = q3d::fuzz::chosen_reader(data, size);
  if (reader == 'p') read_plan(scratch, bytes);
  if (reader == 'm') read_stage_manifest(scratch, bytes);
  if (reader == 'l') read_list(scratch, bytes);
  if (reader == 'e') read_export(scratch, bytes);
  if (reader == 'w') {
    scratch.write("world/world.json", bytes);
    q3d::pipeline::candidates::is_rendered(scratch.root() / "world");
  }
  return 0;
}
