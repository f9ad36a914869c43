#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "pipeline/build/build.h"
#include "pipeline/build/dry_run.h"
#include "pipeline/cli/build_pages.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/stages/stage.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  ConfigArguments config;
  std::filesystem::path veto;
  std::filesystem::path corrections;
  run::RunOptions run;
  std::string until;
  bool is_dry = false;
  bool json = false;
};

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

// Returns the words that run the whole build again.
std::vector<std::string> command_words(const Arguments& arguments) {
  std::vector<std::string> words{"build"};
  const auto add = [&](std::initializer_list<std::string> more) { words.insert(words.end(), more); };
  const std::vector<std::string> config = arguments.config.words();
  words.insert(words.end(), config.begin(), config.end());
  if (!arguments.veto.empty()) add({"--veto", arguments.veto.string()});
  if (!arguments.corrections.empty()) add({"--corrections", arguments.corrections.string()});
  if (arguments.run.threads > 0) add({"--threads", std::to_string(arguments.run.threads)});
  if (arguments.run.above_ceiling) add({"--above-ceiling"});
  add({"--out", arguments.run.out.string()});
  return words;
}

int run_dry(const Arguments& arguments) {
  const build::DryRun forecast = build::dry_run(configured(arguments), arguments.run);
  fmt::print("{}", arguments.json ? to_json(forecast).dump() + "\n" : page(forecast));
  return 0;
}

int run_build(const Arguments& arguments) {
  build::BuildRequest request;
  request.command = command_words(arguments);
  if (!arguments.until.empty()) request.until = stages::stage_from_string(arguments.until);
  const build::BuildSummary summary = build::build(configured(arguments), arguments.run, request);
  if (summary.rank != 0) return 0;  // rank 0 reports for all
  if (summary.stopped_after) {
    print_stop(summary, arguments.run.out);
  } else {
    print_summary(summary);
  }
  if (arguments.json) {
    fmt::print("{}\n",
               (summary.stopped_after ? stop_json(summary, arguments.run.out) : to_json(summary)).dump());
  }
  return 0;
}

// Declares the options that run less than the whole build.
void partial_options(CLI::App& command, Arguments& arguments) {
  const auto names = stages::stage_names();
  CLI::Option* until =
      command
          .add_option("--until", arguments.until,
                      "stop after this stage, and say what is there and which command goes on")
          ->check(CLI::IsMember(std::vector<std::string>(names.begin(), names.end())));
  command
      .add_flag("--dry-run", arguments.is_dry,
                "say what would be made and what would be used again, and why, and write nothing")
      ->excludes(until);
}

}  // namespace

Command add_build(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  arguments->run.shares_units = true;
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
  ranks_option(*command);
  threads_option(*command, arguments->run.threads);
  partial_options(*command, *arguments);
  above_ceiling_flag(*command, arguments->run.above_ceiling);
  json_flag(*command, arguments->json);
  quiet_flag(*command, arguments->run.quiet);
  command->footer(
      "Examples:\n"
      "  quadruped3d build --config configs/sample.json --config out/thresholds.json --out out\n"
      "  quadruped3d build -c my.json -o out --json > summary.json\n"
      "  quadruped3d build -c my.json -o out --veto veto.txt\n"
      "  quadruped3d build -c my.json -o out --set tta.learning_rate=2e-6 --device cuda:1\n"
      "  quadruped3d build -c my.json -c out/thresholds.json -o out --dry-run\n"
      "  quadruped3d build -c my.json -c out/thresholds.json -o out --until predict\n"
      "  quadruped3d build -c configs/world_pools/animal3d.json -o out/pools/animal3d\n"
      "  quadruped3d build -c my.json -c out/thresholds.json -o out --ranks 4    on four GPUs\n"
      "If a build was stopped or killed, run the same command again: it continues where it left off and\n"
      "ends with the same bytes. Ranks, which --ranks, torchrun or srun starts, share the units, each with\n"
      "a GPU or a part of the cores, and publish the bytes of one process (docs/scale.md). Bad pictures\n"
      "and records never stop a build; they are counted and listed with their reasons in verdicts.csv.\n"
      "Pseudo labels need thresholds in the config; `quadruped3d calibrate` finds them. Datasets of the\n"
      "role \"truth\" or \"2d_only\" bring their own labels and need neither thresholds nor a network\n"
      "(docs/config.md).");
  return [arguments] { return arguments->is_dry ? run_dry(*arguments) : run_build(*arguments); };
}

}  // namespace q3d::pipeline::cli
