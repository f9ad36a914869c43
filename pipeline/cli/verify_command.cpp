#include "pipeline/cli/verify_command.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>
#include <stdexcept>

#include "pipeline/dataset/verify.h"
#include "pipeline/run/errors.h"
#include "pipeline/run/printable.h"
#include "pipeline/run/words.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments : RepairArguments {
  bool stages = false;
  bool repair = false;
};

int check(const Arguments& arguments) {
  if (!arguments.config.files.empty()) throw run::ConfigError("--config belongs to --repair");
  const dataset::VerifySummary summary =
      dataset::verify(arguments.dataset, arguments.run.quiet, arguments.stages);
  for (const std::string& problem : summary.problems)
    fmt::print(stderr, "problem: {}\n", run::printable_line(problem));
  const bool sound = summary.problems.empty();
  const auto problems = static_cast<std::int64_t>(summary.problems.size());
  const std::string stages =
      arguments.stages ? ", " + run::counted(summary.stage_files, "file") + " of stages" : std::string();
  fmt::print(stderr, "{}: {}, {}, {}{} read: {}\n", summary.folder.string(),
             run::counted(summary.shards, "shard"), run::counted(summary.samples, "sample"),
             run::counted(summary.pictures, "picture"), stages,
             sound ? "sound" : run::counted(problems, "problem"));
  if (arguments.json) {
    const nlohmann::ordered_json document = {
        {"dataset", summary.folder.string()}, {"sound", sound},
        {"shards", summary.shards},           {"samples", summary.samples},
        {"pictures", summary.pictures},       {"stage_files", summary.stage_files},
        {"problems", summary.problems}};
    fmt::print("{}\n", document.dump());
  }
  return sound ? 0 : 1;
}

}  // namespace

Command add_verify_with(CLI::App& app, const RepairCommand& repair) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "verify");
  command
      ->add_option("dataset", arguments->dataset,
                   "a dataset's folder, or an output folder (its newest dataset is checked)")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_flag("--stages", arguments->stages, "check the stages of its output folder too");
  command->add_flag("--repair", arguments->repair,
                    "move damaged files to OUT/quarantine and make them again, those of the stages too");
  config_option(*command, arguments->config,
                "with --repair: the build's config files, to make again what has no copy");
  device_option(*command, arguments->config);
  threads_option(*command, arguments->run.threads, "with --repair: number of threads (0 = all cores)");
  json_flag(*command, arguments->json);
  quiet_flag(*command, arguments->run.quiet);
  command->footer(
      "Examples:\n"
      "  quadruped3d verify out\n"
      "  quadruped3d verify out/quadruped3d-0123456789ab --stages --json\n"
      "  quadruped3d verify out --repair --config my.json --config out/thresholds.json\n"
      "Exit code 0 means that the dataset is sound, or has been repaired. Exit code 1 means that something "
      "is\n"
      "wrong; every problem is listed. Without --config, --repair uses undamaged copies in the output "
      "folder\n"
      "alone. A repaired file has the same bytes as before. docs/reliability.md says what is checked.");
  return [arguments, repair] {
    if (!arguments->repair) return check(*arguments);
    if (!repair) throw std::logic_error("verify --repair runs in the program that can build");
    return repair(*arguments);
  };
}

Command add_verify(CLI::App& app) {
  return add_verify_with(app, nullptr);
}

}  // namespace q3d::pipeline::cli
