#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "manifests/atomic_file.h"
#include "pipeline/build/build.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/dataset/sentences.h"
#include "pipeline/run/command_line.h"
#include "pipeline/run/progress.h"
#include "pipeline/run/words.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  ConfigArguments config;
  std::filesystem::path veto;
  std::filesystem::path corrections;
  run::RunOptions run;
  bool json = false;
};

double percent(std::int64_t part, std::int64_t whole) {
  return whole == 0 ? 0.0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

void print_quality(const dataset::DatasetManifest& manifest) {
  fmt::print(stderr, "  quality     {}\n", dataset::quality_sentence(manifest));
  for (const dataset::Warning& warning : manifest.warnings) {
    fmt::print(stderr, "  WARNING     {}\n", warning.message);
  }
}

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

// Counts by the enumerators' names.
template <typename Enum>
nlohmann::ordered_json to_json(const std::map<Enum, std::int64_t>& counts) {
  nlohmann::ordered_json object = nlohmann::ordered_json::object();
  for (const auto& [key, count] : counts) object[std::string(manifests::to_string(key))] = count;
  return object;
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
          {"dataset", summary.folder.string()},
          {"content_id", summary.dataset.content_id},
          {"reasons", to_json(summary.dataset.reasons)},
          {"notes", dataset::notes_json(summary.notes)},
          {"quality", dataset::quality_sentence(summary.dataset)},
          {"warnings", dataset::to_json(summary.dataset.warnings)},
          {"up_to_date", summary.was_up_to_date},
          {"crops_encoded", summary.crops_encoded},
          {"seconds", summary.seconds}};
}

// --veto and --corrections replace the config's keys of these names.
config::BuildConfig configured(const Arguments& arguments) {
  config::BuildConfig config = config::load_build_config(arguments.config.files, arguments.config.settings());
  const auto replace = [&](const char* key, const std::filesystem::path& file,
                           std::filesystem::path& target) {
    if (file.empty()) return;
    target = std::filesystem::absolute(file);
    config.as_written[key] = file.string();
  };
  replace("veto", arguments.veto, config.veto);
  replace("corrections", arguments.corrections, config.corrections);
  return config;
}

}  // namespace

Command add_build(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "build");
  config_option(*command, arguments->config)->required();
  device_option(*command, arguments->config);
  out_option(*command, arguments->run.out, "output folder; OUT/latest will be the newest dataset")
      ->required();
  command
      ->add_option("--veto", arguments->veto,
                   "file with the ids of samples to leave out, one per line; a reason may follow after a tab")
      ->check(CLI::ExistingFile);
  command
      ->add_option("--corrections", arguments->corrections,
                   "file of corrected keypoints, as `quadruped3d corrections` writes it")
      ->check(CLI::ExistingFile);
  threads_option(*command, arguments->run.threads);
  above_ceiling_flag(*command, arguments->run.above_ceiling);
  json_flag(*command, arguments->json);
  quiet_flag(*command, arguments->run.quiet);
  command->footer(
      "Examples:\n"
      "  quadruped3d build --config configs/sample.json --config out/thresholds.json --out out\n"
      "  quadruped3d build -c my.json -o out --json > summary.json\n"
      "  quadruped3d build -c my.json -o out --veto veto.txt\n"
      "  quadruped3d build -c my.json -o out --set tta.learning_rate=2e-6 --device cuda:1\n"
      "  quadruped3d build -c configs/world_pools/animal3d.json -o out/pools/animal3d\n"
      "If a build was stopped or killed, run the same command again: it continues where it left off and\n"
      "ends with the same bytes. Bad pictures and records never stop a build; they are counted and listed\n"
      "with their reasons in verdicts.csv.\n"
      "Pseudo labels need thresholds in the config; `quadruped3d calibrate` finds them. Datasets of the\n"
      "role \"truth\" or \"2d_only\" bring their own labels and need neither thresholds nor a network\n"
      "(docs/config.md).");
  return [arguments] {
    const build::BuildSummary summary = build::build(configured(*arguments), arguments->run);
    print_summary(summary);
    if (arguments->json) fmt::print("{}\n", to_json(summary).dump());
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
