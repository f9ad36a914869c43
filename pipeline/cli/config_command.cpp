#include <fmt/format.h>

#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
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
    fmt::print(stderr, "the profiles; with --config, a whole config with its profile expanded\n");
  } else {
    document = config::effective_config(config::load_build_config(arguments.configs));
  }
  fmt::print("{}\n", document.dump(2));
  return 0;
}

}  // namespace

Command add_config(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("config", "what a config says, nothing left unsaid");
  command->require_subcommand(1);
  CLI::App* shown =
      command->add_subcommand("show", "the config with its profile expanded and defaults filled in, as JSON");
  shown->add_option("-c,--config", arguments->configs, "JSON config; a second one is laid over the first")
      ->check(CLI::ExistingFile);
  const char* const footer =
      "Examples:\n"
      "  quadruped3d config show                                  what the profiles stand for\n"
      "  quadruped3d config show -c my.json -c out/thresholds.json\n"
      "What is printed is a config again and gives the same dataset. docs/config.md explains every key.";
  command->footer(footer);
  shown->footer(footer);
  return [arguments] { return show(*arguments); };
}

}  // namespace q3d::pipeline::cli
