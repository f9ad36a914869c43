#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <memory>

#include "manifests/atomic_file.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/evaluation/adaptation_figure.h"
#include "pipeline/evaluation/paper_tables.h"
#include "pipeline/evaluation/report.h"
#include "pipeline/run/progress.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  ConfigArguments config;
  std::filesystem::path checkpoint;
  evaluation::EvaluationOptions options;
  bool species = false;
  bool paper_tables = false;
  bool json = false;
};

void write_paper_tables(const Arguments& arguments, const evaluation::Evaluation& result,
                        const evaluation::Tables& tables) {
  const bool is_rendered = std::any_of(result.datasets.begin(), result.datasets.end(),
                                       [](const auto& dataset) { return dataset.is_rendered; });
  const std::string text = evaluation::paper_tables(tables, is_rendered);
  manifests::write_file_atomically(arguments.options.run.out / "paper_tables.md", text);
  fmt::print(arguments.json ? stderr : stdout, "\n{}", text);
}

// Writes the figure, or removes that of an earlier evaluation, which would not match the new tables.
void write_adaptation_figure(const std::filesystem::path& out, const evaluation::Tables& tables) {
  const std::filesystem::path path = out / "adaptation.svg";
  const std::string svg = evaluation::adaptation_figure(tables);
  if (svg.empty()) {
    std::filesystem::remove(path);
  } else {
    manifests::write_file_atomically(path, svg);
  }
}

// Writes the results of rank 0 and tells about them.
void report(const Arguments& arguments, const evaluation::Evaluation& result) {
  const std::filesystem::path& out = arguments.options.run.out;
  const evaluation::Tables tables = evaluation::make_tables(result);
  evaluation::write_evaluation(out, result, tables);
  write_adaptation_figure(out, tables);
  if (!result.device_warning.empty()) fmt::print(stderr, "warning: {}\n", result.device_warning);
  for (const auto& dataset : result.datasets) {
    for (const std::string& note : dataset.notes) fmt::print(stderr, "note: {}: {}\n", dataset.name, note);
  }
  if (arguments.paper_tables) write_paper_tables(arguments, result, tables);
  std::FILE* const people = arguments.json ? stderr : stdout;
  fmt::print(people, "\n{} (sha256 {}...) on {}, in {}\n\n{}", result.checkpoint,
             result.checkpoint_sha256.substr(0, 12), result.device, run::human_duration(result.seconds),
             evaluation::summary_text(result, tables, arguments.species));
  fmt::print(
      people,
      "all samples: {}\nTo test whether another network is better, evaluate it too, and give `quadruped3d "
      "compare` both folders.\n",
      (out / "samples.csv").string());
  if (arguments.json) fmt::print("{}\n", evaluation::to_json(result, tables).dump());
}

int run(const Arguments& arguments) {
  const auto config = evaluation::load_evaluation_config(arguments.config.files, arguments.checkpoint,
                                                         arguments.config.settings());
  evaluation::evaluate(config, arguments.options,
                       [&](const evaluation::Evaluation& result) { report(arguments, result); });
  return 0;
}

void add_settings(CLI::App& command, evaluation::EvaluationOptions& options) {
  command
      .add_option("--tta", options.settings.tta_iterations,
                  "also measure after this many adaptation steps (at the config's tta.learning_rate)")
      ->check(CLI::NonNegativeNumber);
  command
      .add_option("--tta-curve", options.settings.curve,
                  "also measure these iterates of adaptation as they are, such as 0,10,20,30,40,50,60,70")
      ->delimiter(',');
  command
      .add_option("--visible", options.settings.visible_shares,
                  "also run --tta with only these shares of the visible keypoints; the metrics use all")
      ->delimiter(',');
  command
      .add_option("--limit", options.limit, "take this many samples of each dataset, evenly spaced (0 = all)")
      ->check(CLI::NonNegativeNumber);
  command.add_option("--seed", options.seed, "seed of k-means and of the keypoints that --visible hides")
      ->capture_default_str();
  command.add_flag(
      "--official-means", options.official_means,
      "count samples without a visible keypoint or without truth as 0, as the official code does");
}

}  // namespace

Command add_evaluate(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  arguments->options.run.shares_units = true;
  CLI::App* command = declare(app, "evaluate");
  config_option(*command, arguments->config)->required();
  device_option(*command, arguments->config);
  command
      ->add_option("--checkpoint", arguments->checkpoint,
                   "weights to measure, instead of the config's network.checkpoint")
      ->check(CLI::ExistingFile);
  out_option(*command, arguments->options.run.out, "folder for evaluation.json, samples.csv and tables.csv")
      ->required();
  add_settings(*command, arguments->options);
  command->add_flag(
      "--paper-tables", arguments->paper_tables,
      "also print the paper's tables with the paper's numbers, and write them to OUT/paper_tables.md");
  command->add_flag("--species", arguments->species, "also show the table by species");
  ranks_option(*command);
  threads_option(*command, arguments->options.run.threads);
  json_flag(*command, arguments->json, "print evaluation.json to stdout");
  quiet_flag(*command, arguments->options.run.quiet);
  command->footer(
      "Examples:\n"
      "  quadruped3d evaluate --config configs/world_evaluation.json \\\n"
      "      --checkpoint out/stage1/model.safetensors --out out/stage1/evaluation\n"
      "  quadruped3d evaluate -c my.json -o out/eval --limit 50                      a quick look\n"
      "  quadruped3d evaluate -c my.json -o out/eval --tta 30 --visible 0.7,0.5,0.3  with adaptation\n"
      "  quadruped3d evaluate -c my.json -o out/eval --tta-curve 0,5,10,20,30,50,70  does it overfit?\n"
      "An evaluation that was stopped goes on with the same command. Ranks, which --ranks, torchrun or srun\n"
      "starts, share it (docs/scale.md). docs/evaluation.md defines every number.");
  return [arguments] { return run(*arguments); };
}

}  // namespace q3d::pipeline::cli
