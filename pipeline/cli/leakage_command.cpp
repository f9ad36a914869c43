#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/leakage/leakage_run.h"
#include "pipeline/run/command_line.h"
#include "pipeline/run/progress.h"
#include "pipeline/run/words.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  ConfigArguments config;
  run::RunOptions run;
  bool json = false;
};

std::size_t count_leaks(const leakage::LeakageRunSummary& summary) {
  std::size_t count = 0;
  for (const auto& [evidence, leaks] : summary.leaks_by_evidence) count += leaks;
  return count;
}

void print_summary(const leakage::LeakageRunSummary& summary, const Arguments& arguments) {
  for (const std::string& note : summary.notes) fmt::print(stderr, "note: {}\n", note);
  fmt::print(stderr, "\n{} of {} compared with {} in {}\n", run::counted(summary.pool_pictures, "picture"),
             run::counted(summary.candidates, "candidate"),
             run::counted(summary.test_pictures, "test picture"), run::human_duration(summary.seconds));
  fmt::print(stderr, "  candidates whose picture is in a test set: {}\n", count_leaks(summary));
  for (const auto& [evidence, leaks] : summary.leaks_by_evidence) {
    fmt::print(stderr, "    {:<12} {}\n", evidence, leaks);
  }
  fmt::print(stderr, "  groups of pictures in the pool that look alike: {} ({})\n", summary.groups,
             run::counted(summary.pictures_in_groups, "picture"));
  fmt::print(stderr,
             "  page with the pictures: {}\n  lists beside it: leaks.csv, duplicates.csv and leakage.json\n",
             (arguments.run.out / "leakage.html").string());
  if (summary.test_pictures == 0) {
    fmt::print(stderr, "Name the test sets under \"leakage\" in the config (docs/config.md).\n");
    return;
  }
  std::vector<std::string> words{"build"};
  const std::vector<std::string> config = arguments.config.words();
  words.insert(words.end(), config.begin(), config.end());
  words.insert(words.end(), {"--out", arguments.run.out.string()});
  fmt::print(stderr, "A build with the same config leaves out the pseudo labels among them.\nnext: {}\n",
             run::command_line(words));
}

}  // namespace

Command add_leakage(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "leakage");
  config_option(*command, arguments->config)->required();
  out_option(*command, arguments->run.out, "folder for the lists, the HTML page and the cache of hashes")
      ->required();
  threads_option(*command, arguments->run.threads);
  json_flag(*command, arguments->json);
  quiet_flag(*command, arguments->run.quiet);
  command->footer(
      "Examples:\n"
      "  quadruped3d leakage --config my.json --out out\n"
      "The config is that of a build, with the test sets under \"leakage\". It needs no \"network\".\n"
      "  \"leakage\": { \"test_sets\": [\n"
      "    { \"name\": \"animal3d\", \"format\": \"prima\", \"root\": \"animal3d\",\n"
      "      \"annotations\": \"test.json\", \"split\": \"test\" } ] }\n"
      "A copy is recognised by equal bytes, by its ImageNet, COCO or VOC name, or by its content. The\n"
      "search by content finds pictures that were resized, recompressed or mirrored, but not cut-outs.\n"
      "The hashes are cached in the output folder. Use the output folder of the build, so that the build\n"
      "finds them there.");
  return [arguments] {
    const leakage::LeakageRunSummary summary =
        leakage::run_leakage(config::load_build_config(arguments->config.files, arguments->config.settings(),
                                                       config::NetworkKey::optional),
                             arguments->run);
    print_summary(summary, *arguments);
    if (arguments->json) {
      const nlohmann::ordered_json document = {{"candidates", summary.candidates},
                                               {"pool_pictures", summary.pool_pictures},
                                               {"test_pictures", summary.test_pictures},
                                               {"leaks", count_leaks(summary)},
                                               {"leaks_by_evidence", summary.leaks_by_evidence},
                                               {"groups", summary.groups},
                                               {"pictures_in_groups", summary.pictures_in_groups},
                                               {"seconds", summary.seconds}};
      fmt::print("{}\n", document.dump());
    }
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
