#include <fmt/format.h>

#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/evaluation/labels.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  ConfigArguments config;
  evaluation::LabelOptions options;
  std::filesystem::path report;
  bool json = false;
};

int run(const Arguments& arguments) {
  const evaluation::LabelEvaluation result = evaluation::evaluate_labels(
      config::load_build_config(arguments.config.files, arguments.config.settings()), arguments.options);
  if (!arguments.report.empty()) evaluation::write_label_evaluation(arguments.report, result);
  std::FILE* const people = arguments.json ? stderr : stdout;
  fmt::print(people, "\n{}\n{}", result.dataset, evaluation::summary_text(result));
  if (!arguments.report.empty()) {
    fmt::print(people, "all candidates: {}\n", (arguments.report / "labels.csv").string());
  }
  if (arguments.json) fmt::print("{}\n", evaluation::to_json(result).dump());
  return 0;
}

}  // namespace

Command add_evaluate_labels(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  evaluation::LabelOptions& options = arguments->options;
  CLI::App* command = declare(app, "evaluate-labels");
  config_option(*command, arguments->config, "the build's config, thresholds included")->required();
  out_option(*command, options.run.out, "the build's output folder")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("--truth", options.truth, "file with the hidden truth of the pool's pictures")
      ->check(CLI::ExistingFile);
  command->add_option("--masks", options.masks, "folder that the truth's mask paths start from")
      ->check(CLI::ExistingDirectory);
  command->add_option("--report", arguments->report, "folder for labels.json and labels.csv");
  threads_option(*command, options.run.threads);
  json_flag(*command, arguments->json, "print labels.json to stdout");
  quiet_flag(*command, options.run.quiet);
  command->footer(
      "Example:\n"
      "  quadruped3d evaluate-labels --config configs/world_stage2.json --config out/thresholds.json \\\n"
      "      --out out --truth data/world/truth/superanimal_quadruped_train.json --masks data/world \\\n"
      "      --report out/labels\n"
      "The command measures the whole pool, the kept labels, the refined labels before and after\n"
      "refinement, and the discarded predictions. It does not run the network: it reads the build's\n"
      "predictions from its output folder. docs/evaluation.md defines every number.");
  return [arguments] { return run(*arguments); };
}

}  // namespace q3d::pipeline::cli
