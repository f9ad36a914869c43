#include "pipeline/cli/build_pages.h"

#include <fmt/format.h>

#include <cstdio>

#include "manifests/valid_utf8.h"
#include "pipeline/dataset/sentences.h"
#include "pipeline/run/command_line.h"
#include "pipeline/run/progress_text.h"
#include "pipeline/run/words.h"
#include "pipeline/stages/stages.h"
#include "pipeline/status/folder_status.h"
#include "pipeline/status/status_page.h"

namespace q3d::pipeline::cli {
namespace {

double percent(std::int64_t part, std::int64_t whole) {
  return whole == 0 ? 0.0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

void print_quality(const dataset::DatasetManifest& manifest) {
  fmt::print(stderr, "  quality     {}\n", dataset::quality_sentence(manifest));
  for (const dataset::Warning& warning : manifest.warnings) {
    fmt::print(stderr, "  WARNING     {}\n", warning.message);
  }
}

// Returns the counts by the enumerators' names.
template <typename Enum>
nlohmann::ordered_json to_json(const std::map<Enum, std::int64_t>& counts) {
  nlohmann::ordered_json object = nlohmann::ordered_json::object();
  for (const auto& [key, count] : counts) object[std::string(manifests::to_string(key))] = count;
  return object;
}

}  // namespace

void print_summary(const build::BuildSummary& summary) {
  const dataset::Counts& counts = summary.dataset.counts;
  const auto line = [&](const char* name, std::int64_t count) {
    fmt::print(stderr, "  {:<10} {:>8}  {:5.1f} %\n", name, count, percent(count, counts.candidates));
  };
  fmt::print(stderr, "\n{} {} in {}\n", summary.dataset.name,
             summary.was_up_to_date ? "was up to date" : "built", run::human_duration(summary.seconds));
  fmt::print(stderr, "  {:<10} {:>8}\n", "candidates", counts.candidates);
  line("retained", counts.retained);
  line("refined", counts.refined);
  line("discarded", counts.discarded);
  line("failed", counts.failed);
  for (const auto& [reason, count] : summary.dataset.reasons)
    fmt::print(stderr, "    {:<22} {}\n", manifests::to_string(reason), count);
  fmt::print(stderr, "  labels    ");
  for (const auto& [kind, count] : summary.dataset.labels) {
    if (count > 0) fmt::print(stderr, "  {} {}", manifests::to_string(kind), count);
  }
  fmt::print(stderr, "\n");
  print_quality(summary.dataset);
  fmt::print(stderr, "  {} in {}\n",
             run::counted(static_cast<std::int64_t>(summary.dataset.shards.size()), "shard"),
             summary.folder.string());
  fmt::print(stderr, "  all verdicts: {}\n", (summary.folder / "verdicts.csv").string());
  fmt::print(stderr, "next: {}\n      {}\n", run::command_line({"verify", summary.folder.string()}),
             run::command_line({"report", summary.folder.string()}));
}

nlohmann::ordered_json to_json(const build::BuildSummary& summary) {
  const dataset::Counts& counts = summary.dataset.counts;
  return {{"candidates", counts.candidates},
          {"retained", counts.retained},
          {"refined", counts.refined},
          {"discarded", counts.discarded},
          {"failed", counts.failed},
          {"labels", to_json(summary.dataset.labels)},
          {"shards", summary.dataset.shards.size()},
          {"dataset", manifests::valid_utf8(summary.folder.string())},
          {"content_id", summary.dataset.content_id},
          {"reasons", to_json(summary.dataset.reasons)},
          {"notes", dataset::notes_json(summary.notes)},
          {"quality", dataset::quality_sentence(summary.dataset)},
          {"warnings", dataset::to_json(summary.dataset.warnings)},
          {"up_to_date", summary.was_up_to_date},
          {"crops_encoded", summary.crops_encoded},
          {"seconds", summary.seconds}};
}

void print_stop(const build::BuildSummary& summary, const std::filesystem::path& out) {
  fmt::print(stderr, "\n{} stopped after the stage {}, as asked, in {}; no dataset is published\n{}",
             summary.plan.name, to_string(*summary.stopped_after), run::human_duration(summary.seconds),
             status::stage_table(status::build_status(out, summary.plan), "  "));
  fmt::print(stderr, "next: {}\n", run::command_line(summary.plan.command));
}

nlohmann::ordered_json stop_json(const build::BuildSummary& summary, const std::filesystem::path& out) {
  return {{"stopped_after", to_string(*summary.stopped_after)},
          {"build", status::to_json(status::build_status(out, summary.plan))},
          {"notes", dataset::notes_json(summary.notes)},
          {"crops_encoded", summary.crops_encoded},
          {"seconds", summary.seconds}};
}

std::string page(const build::DryRun& forecast) {
  std::string text =
      fmt::format("dry run of {}: {} in {}; nothing was written\n", forecast.version,
                  run::counted(forecast.candidates, "candidate"), run::counted(forecast.units, "unit"));
  for (const build::StageForecast& stage : forecast.stages) {
    text +=
        fmt::format("  {:<8} {}  uses {} again, makes {}", to_string(stage.stage),
                    stage.key.substr(0, stages::kShortKey), run::counted(stage.reused, "unit"), stage.made);
    if (stage.not_needed > 0) text += fmt::format(", needs none for {} with a shard", stage.not_needed);
    text += "\n";
    for (const std::string& why : stage.why) text += fmt::format("           {}\n", why);
  }
  return text + (forecast.is_up_to_date ? "  The dataset is finished and sound: a build would make nothing.\n"
                                        : "  A build would then publish the dataset.\n");
}

nlohmann::ordered_json to_json(const build::DryRun& forecast) {
  nlohmann::ordered_json stages = nlohmann::ordered_json::array();
  for (const build::StageForecast& stage : forecast.stages) {
    stages.push_back({{"stage", to_string(stage.stage)},
                      {"key", stage.key},
                      {"folder", manifests::valid_utf8(stage.folder.string())},
                      {"units_reused", stage.reused},
                      {"units_made", stage.made},
                      {"units_not_needed", stage.not_needed},
                      {"why", stage.why}});
  }
  return {{"version", forecast.version},
          {"candidates", forecast.candidates},
          {"units", forecast.units},
          {"up_to_date", forecast.is_up_to_date},
          {"stages", stages}};
}

}  // namespace q3d::pipeline::cli
