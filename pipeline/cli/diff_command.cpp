#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/derived/difference.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  std::filesystem::path before;
  std::filesystem::path after;
  bool json = false;
};

}  // namespace

Command add_diff(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "diff");
  command->add_option("before", arguments->before, "a dataset's folder, or an output folder")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("after", arguments->after, "another one")->required()->check(CLI::ExistingDirectory);
  json_flag(*command, arguments->json, "print everything as JSON in one line");
  command->footer(
      "Example:\n"
      "  quadruped3d diff out/pool-0123456789ab out/latest\n"
      "It tells which candidates only one version has, which verdicts differ, and how far labels moved that\n"
      "both keep.");
  return [arguments] {
    const derived::VersionDifference difference =
        derived::compare_versions(arguments->before, arguments->after);
    if (arguments->json) {
      fmt::print("{}\n", derived::to_json(difference).dump());
    } else {
      fmt::print("{}", derived::page_of(difference));
    }
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
