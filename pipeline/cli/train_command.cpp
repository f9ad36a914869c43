#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/run/progress.h"
#include "pipeline/training/training_run.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  ConfigArguments config;
  std::string stage;
  training::TrainingOptions options;
  bool json = false;
};

void print_summary(const training::TrainingSummary& summary) {
  fmt::print(stderr, "\n{} of {} steps done, {} of them now, in {}\n", summary.steps_done,
             summary.steps_total, summary.steps_here, run::human_duration(summary.seconds));
  if (!summary.left_out.empty()) {
    fmt::print(stderr, "  left out because of damage: {}\n", summary.left_out.size());
  }
  if (summary.finished) {
    fmt::print(stderr, "  weights: {}\n", summary.model.string());
  } else {
    fmt::print(stderr, "  run the same command to continue\n");
  }
}

nlohmann::ordered_json to_json(const training::TrainingSummary& summary) {
  return {{"steps_done", summary.steps_done}, {"steps_total", summary.steps_total},
          {"steps_here", summary.steps_here}, {"finished", summary.finished},
          {"last_loss", summary.last_loss},   {"model", summary.model.string()},
          {"left_out", summary.left_out},     {"seconds", summary.seconds}};
}

}  // namespace

Command add_train(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "train");
  config_option(*command, arguments->config)->required();
  device_option(*command, arguments->config);
  command->add_option("-s,--stage", arguments->stage, "name of the stage in the config, such as 1 or 3")
      ->required();
  out_option(*command, arguments->options.out, "folder of this run, for state, log and weights")->required();
  ranks_option(*command);
  threads_option(*command, arguments->options.threads,
                 "number of threads that prepare batches (0 = all cores)");
  command
      ->add_option("--max-steps", arguments->options.max_steps,
                   "save and stop after this many steps (0 = train to the end)")
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--skip-damaged", arguments->options.skip_damaged,
                    "go on without damaged shards and samples; each is counted and named");
  json_flag(*command, arguments->json);
  quiet_flag(*command, arguments->options.quiet);
  command->footer(
      "Examples:\n"
      "  quadruped3d train --config configs/world_training.json --stage 1 --out out/stage1\n"
      "  quadruped3d train -c my.json --stage 3 -o out/stage3 --max-steps 1000\n"
      "  quadruped3d train -c my.json --stage 3 -o out/trial --set batch=8 --set seed=2\n"
      "  quadruped3d train -c my.json --stage 1 -o out/stage1 --ranks 4    on four GPUs of this machine\n"
      "If a run was stopped, run the same command again: it continues from the newest state and ends with\n"
      "the same weights as a run that was never stopped. Training needs pose and shape priors; `quadruped3d\n"
      "init --priors FILE` writes those of the synthetic quadruped. docs/training.md describes the config, "
      "the log\n"
      "and the state.");
  return [arguments] {
    const training::TrainingSummary summary =
        training::train(training::settings::load_training_config(arguments->config.files, arguments->stage,
                                                                 arguments->config.settings()),
                        arguments->options);
    if (summary.rank != 0) return 0;  // rank 0 reports for all
    print_summary(summary);
    if (arguments->json) fmt::print("{}\n", to_json(summary).dump());
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
