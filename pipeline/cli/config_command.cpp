#include <fmt/format.h>

#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/config/effective_config.h"
#include "pipeline/config/profiles.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  std::vector<std::filesystem::path> configs;
};

int show(const Arguments& arguments) {
  nlohmann::ordered_json document;
  if (arguments.configs.empty()) {
    for (const std::string& name : config::profile_names())
      document["profiles"][name] = config::profile_layer(name);
    fmt::print(stderr, "these are the profiles; with --config, the command prints a whole config\n");
  } else {
    document = config::effective_config(config::load_build_config(arguments.configs));
  }
  fmt::print("{}\n", document.dump(2));
  return 0;
}

}  // namespace

Command add_config(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "config");
  command->require_subcommand(1);
  CLI::App* shown = command->add_subcommand(
      "show", "print the config as JSON, with its profile expanded and all defaults filled in");
  config_option(*shown, arguments->configs);
  const char* const footer =
      "Examples:\n"
      "  quadruped3d config show                                  what each profile stands for\n"
      "  quadruped3d config show -c my.json -c out/thresholds.json\n"
      "The output is a config again and gives the same dataset. docs/config.md explains every key.";
  command->footer(footer);
  shown->footer(footer);
  return [arguments] { return show(*arguments); };
}

}  // namespace q3d::pipeline::cli
