#include "pipeline/status/status_page.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string_view>

#include "manifests/valid_utf8.h"
#include "pipeline/run/command_line.h"
#include "pipeline/run/words.h"
#include "pipeline/stages/stages.h"

namespace q3d::pipeline::status {
namespace {

using nlohmann::ordered_json;
using stages::Stage;

constexpr std::size_t kShownRanges = 8;

std::string short_key(const std::string& key) {
  return key.substr(0, stages::kShortKey);
}

// Returns "unit 3 is" or "units 0 to 5, 8 and 11 are". A list of many ranges is cut short.
std::string units_are(const std::vector<std::int64_t>& units) {
  std::vector<std::string> ranges;
  for (std::size_t first = 0; first < units.size();) {
    std::size_t last = first;
    while (last + 1 < units.size() && units[last + 1] == units[last] + 1) ++last;
    ranges.push_back(first == last ? fmt::format("{}", units[first])
                                   : fmt::format("{} to {}", units[first], units[last]));
    first = last + 1;
  }
  if (ranges.size() > kShownRanges) {
    ranges.resize(kShownRanges);
    ranges.emplace_back("more");
  }
  std::string text = ranges.front();
  for (std::size_t i = 1; i < ranges.size(); ++i) {
    text += (i + 1 == ranges.size() ? " and " : ", ") + ranges[i];
  }
  return units.size() == 1 ? fmt::format("unit {} is", text) : fmt::format("units {} are", text);
}

// Returns a remark on a stage that follows its numbers.
std::string remark(const StageStatus& stage) {
  if (stage.stage == Stage::fidelity) return "has no file; every build computes it again";
  if (stage.stage == Stage::ingest) {
    return stage.has_manifest ? stage.manifest.string() : "the build wrote no plan";
  }
  std::string text = stage.manifest.string();
  if (!stage.has_manifest) text += " is not there";
  if (stage.not_needed > 0) {
    text += fmt::format("; {} with a shard {} none", run::counted(stage.not_needed, "unit"),
                        stage.not_needed == 1 ? "needs" : "need");
  }
  if (!stage.missing.empty()) text += fmt::format("; {} missing", units_are(stage.missing));
  if (!stage.damaged.empty()) {
    text +=
        fmt::format("; of these, {} damaged: the file is gone or has another size", units_are(stage.damaged));
  }
  return text;
}

std::string line(const std::string& indent, std::string_view name, std::string_view key,
                 std::string_view units, std::string_view text) {
  return fmt::format("{}{:<9} {:<12}  {:>9}  {}\n", indent, name, key, units, text);
}

std::string result_line(const std::string& indent, std::string_view name, const ResultStatus& result) {
  return line(indent, name, "", result.is_there ? "made" : "not made", result.manifest.string());
}

std::string words_of(dataset::ExportState state) {
  switch (state) {
    case dataset::ExportState::complete:
      return "complete";
    case dataset::ExportState::damaged:
      return "damaged";
    case dataset::ExportState::unfinished:
      return "not finished";
    case dataset::ExportState::gone:
      return "gone";
  }
  return {};
}

std::string remark(const dataset::ExportStatus& status) {
  const std::string folder = status.listed.folder.string();
  switch (status.state) {
    case dataset::ExportState::complete:
      return folder;
    case dataset::ExportState::damaged:
      return fmt::format(
          "{}: {} gone or of another size, the first is {}; remove the folder and export again", folder,
          run::counted(static_cast<std::int64_t>(status.damaged.size()), "file"), status.damaged.front());
    case dataset::ExportState::unfinished:
      return folder + ": the same `export` command goes on with it";
    case dataset::ExportState::gone:
      return folder + ": the folder was removed, or holds something else now";
  }
  return {};
}

// Returns one line for each export of a version.
std::string export_lines(const std::vector<dataset::ExportStatus>& exports, const std::string& version) {
  std::string text;
  for (const dataset::ExportStatus& each : exports) {
    if (each.listed.version != version) continue;
    text += fmt::format("    export {}: {} {:<12} {}\n", each.listed.format, short_key(each.key),
                        words_of(each.state), remark(each));
  }
  return text;
}

std::string build_page(const BuildStatus& build) {
  std::string text =
      fmt::format("  {}{}: {} in {}, {}\n", build.version, build.is_latest ? " (latest)" : "",
                  run::counted(build.candidates, "candidate"), run::counted(build.units, "unit"),
                  build.dataset.is_there ? "finished" : "not finished");
  if (build.is_derived) return text + "    It was made from other versions and has no stages of its own.\n";
  text += stage_table(build, "    ");
  if (!build.has_plan) {
    text += "    It has no plan, so its units are counted whatever pictures they were made from.\n";
  }
  if (build.dataset.is_there) return text;
  return text + (build.command.empty() ? std::string("    next: run its `build` again; it goes on\n")
                                       : fmt::format("    next, in the folder where it was started: {}\n",
                                                     run::command_line(build.command)));
}

// A path as JSON takes it.
std::string text_of(const std::filesystem::path& path) {
  return manifests::valid_utf8(path.string());
}

ordered_json to_json(const StageStatus& stage) {
  return {{"stage", to_string(stage.stage)},
          {"key", stage.key},
          {"manifest", stage.manifest.empty() ? ordered_json() : ordered_json(text_of(stage.manifest))},
          {"manifest_is_there", stage.has_manifest},
          {"units_finished", stage.finished},
          {"units_missing", stage.missing},
          {"units_damaged", stage.damaged},
          {"units_not_needed", stage.not_needed}};
}

ordered_json to_json(const dataset::ExportStatus& status) {
  return {{"format", status.listed.format},
          {"version", status.listed.version},
          {"key", status.key},
          {"folder", text_of(status.listed.folder)},
          {"state", words_of(status.state)},
          {"pictures_anyway", status.listed.pictures_anyway},
          {"damaged", status.damaged}};
}

ordered_json to_json(const ResultStatus& result) {
  return {{"manifest", text_of(result.manifest)}, {"is_there", result.is_there}};
}

}  // namespace

std::string stage_table(const BuildStatus& build, const std::string& indent) {
  std::string text = line(indent, "stage", "key", "units", "manifest");
  for (const StageStatus& stage : build.stages) {
    const std::string units =
        stage.stage == Stage::fidelity ? "" : fmt::format("{} of {}", stage.finished, build.units);
    text += line(indent, to_string(stage.stage), short_key(stage.key), units, remark(stage));
  }
  return text + result_line(indent, "dataset", build.dataset) + result_line(indent, "report", build.report);
}

std::string page(const FolderStatus& status) {
  const auto builds = static_cast<std::int64_t>(status.builds.size());
  std::string text = fmt::format("{}: {}\n", status.out.string(), run::counted(builds, "build"));
  for (const BuildStatus& build : status.builds) {
    text += build_page(build) + export_lines(status.exports, build.version);
  }
  if (!status.others.empty()) {
    text += "  Folders of stages that belong to no build here, such as the predictions of `calibrate`:\n";
  }
  for (const OtherStage& other : status.others) {
    text += fmt::format("    {}: {}\n", other.folder.string(), run::counted(other.units, "unit"));
  }
  return text;
}

ordered_json to_json(const BuildStatus& build) {
  ordered_json stages = ordered_json::array();
  for (const StageStatus& stage : build.stages) stages.push_back(to_json(stage));
  return {{"version", build.version},
          {"key", build.key},
          {"latest", build.is_latest},
          {"finished", build.dataset.is_there},
          {"derived", build.is_derived},
          {"has_plan", build.has_plan},
          {"candidates", build.candidates},
          {"units", build.units},
          {"stages", stages},
          {"dataset", to_json(build.dataset)},
          {"report", to_json(build.report)},
          {"command", build.command}};
}

ordered_json to_json(const FolderStatus& status) {
  ordered_json builds = ordered_json::array();
  for (const BuildStatus& build : status.builds) builds.push_back(to_json(build));
  ordered_json others = ordered_json::array();
  for (const OtherStage& other : status.others) {
    others.push_back({{"folder", text_of(other.folder)}, {"units", other.units}});
  }
  ordered_json exports = ordered_json::array();
  for (const dataset::ExportStatus& each : status.exports) exports.push_back(to_json(each));
  return {
      {"folder", text_of(status.out)}, {"builds", builds}, {"other_stages", others}, {"exports", exports}};
}

}  // namespace q3d::pipeline::status
