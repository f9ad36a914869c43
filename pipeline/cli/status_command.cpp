#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/status/folder_status.h"
#include "pipeline/status/status_page.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  std::filesystem::path out;
  bool json = false;
};

}  // namespace

Command add_status(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "status");
  command->add_option("out", arguments->out, "an output folder of `build`")
      ->required()
      ->check(CLI::ExistingDirectory);
  json_flag(*command, arguments->json, "print everything as JSON in one line");
  command->footer(
      "Examples:\n"
      "  quadruped3d status out\n"
      "  quadruped3d status out --json\n"
      "For each build in the folder, finished or not, it lists the stages with their keys, their manifests,\n"
      "the units that are finished and those that are missing, the command that goes on, and the exports. "
      "It\n"
      "changes nothing, and may be used while a build runs. It looks at the files' sizes; `quadruped3d "
      "verify` "
      "reads\n"
      "a finished dataset whole.");
  return [arguments] {
    const status::FolderStatus found = status::folder_status(arguments->out);
    fmt::print("{}", arguments->json ? status::to_json(found).dump() + "\n" : status::page(found));
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
