#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/dataset/verify.h"
#include "pipeline/run/words.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  std::filesystem::path dataset;
  bool json = false;
  bool quiet = false;
};

}  // namespace

Command add_verify(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "verify");
  command
      ->add_option("dataset", arguments->dataset,
                   "a dataset's folder, or an output folder (its newest dataset is checked)")
      ->required()
      ->check(CLI::ExistingDirectory);
  json_flag(*command, arguments->json);
  quiet_flag(*command, arguments->quiet);
  command->footer(
      "Examples:\n"
      "  quadruped3d verify out\n"
      "  quadruped3d verify out/quadruped3d-0123456789ab --json\n"
      "Exit code 0 means that the dataset is sound. Exit code 1 means that something is wrong; every\n"
      "problem is listed. Remove a damaged file of the dataset and run the `build` that made it again: it "
      "is\n"
      "made again, to the same bytes.");
  return [arguments] {
    const dataset::VerifySummary summary = dataset::verify(arguments->dataset, arguments->quiet);
    for (const std::string& problem : summary.problems) fmt::print(stderr, "problem: {}\n", problem);
    const bool sound = summary.problems.empty();
    const auto problems = static_cast<std::int64_t>(summary.problems.size());
    fmt::print(stderr, "{}: {}, {}, {} read: {}\n", summary.folder.string(),
               run::counted(summary.shards, "shard"), run::counted(summary.samples, "sample"),
               run::counted(summary.pictures, "picture"),
               sound ? "sound" : run::counted(problems, "problem"));
    if (arguments->json) {
      const nlohmann::ordered_json document = {
          {"dataset", summary.folder.string()}, {"sound", sound},
          {"shards", summary.shards},           {"samples", summary.samples},
          {"pictures", summary.pictures},       {"problems", summary.problems}};
      fmt::print("{}\n", document.dump());
    }
    return sound ? 0 : 1;
  };
}

}  // namespace q3d::pipeline::cli
