#include <fmt/format.h>

#include <cstdio>
#include <memory>

#include "manifests/atomic_file.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/config/config_schema.h"
#include "pipeline/config/effective_config.h"
#include "pipeline/config/profiles.h"
#include "pipeline/config/settings_page.h"
#include "pipeline/training/settings/training_schema.h"
#include "pipeline/training/settings/training_settings.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  ConfigArguments config;
  std::string schema_of = "build";
  std::filesystem::path page;
  bool writes = false;
};

int show(const Arguments& arguments) {
  nlohmann::ordered_json document;
  if (arguments.config.files.empty() && arguments.config.settings().empty()) {
    for (const std::string& name : config::profile_names())
      document["profiles"][name] = config::profile_layer(name);
    fmt::print(stderr, "these are the profiles; with --config, the command prints a whole config\n");
  } else {
    document = config::effective_config(
        config::load_build_config(arguments.config.files, arguments.config.settings()));
  }
  fmt::print("{}\n", document.dump(2));
  return 0;
}

int print_schema(const Arguments& arguments) {
  const nlohmann::ordered_json schema = arguments.schema_of == "training"
                                            ? training::settings::training_config_schema()
                                            : config::build_config_schema();
  fmt::print("{}\n", schema.dump(2));
  return 0;
}

// Compares the page with the settings, or rewrites its tables.
int make_tables(const Arguments& arguments) {
  const std::string page = manifests::read_file(arguments.page);
  const config::SettingsTables of_training = training::settings::training_settings_tables();
  const std::string wanted = config::with_settings_tables(
      page, config::has_settings_table(page, of_training) ? of_training : config::build_settings_tables());
  if (arguments.writes) {
    manifests::write_file_atomically(arguments.page, wanted);
  } else if (wanted != page) {
    fmt::print(stderr,
               "{0}: its tables differ from the settings; run: quadruped3d config tables {0} --write\n",
               arguments.page.string());
    return 1;
  }
  return 0;
}

CLI::App* add_show(CLI::App& command, Arguments& arguments) {
  CLI::App* shown = command.add_subcommand(
      "show", "print the config as JSON, with its profile expanded and all defaults filled in");
  config_option(*shown, arguments.config);
  device_option(*shown, arguments.config);
  return shown;
}

CLI::App* add_schema(CLI::App& command, Arguments& arguments) {
  CLI::App* schema = command.add_subcommand("schema", "print the JSON Schema of a config, for editors");
  schema->add_option("config", arguments.schema_of, "the config: build or training")
      ->check(CLI::IsMember({"build", "training"}))
      ->capture_default_str();
  return schema;
}

CLI::App* add_tables(CLI::App& command, Arguments& arguments) {
  CLI::App* tables =
      command.add_subcommand("tables", "check the tables of settings in docs/config.md or docs/training.md");
  tables->add_option("page", arguments.page, "Markdown file with the tables' marks")
      ->required()
      ->check(CLI::ExistingFile);
  tables->add_flag("--write", arguments.writes, "make the tables anew");
  return tables;
}

}  // namespace

Command add_config(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "config");
  command->require_subcommand(1);
  CLI::App* shown = add_show(*command, *arguments);
  CLI::App* schema = add_schema(*command, *arguments);
  CLI::App* tables = add_tables(*command, *arguments);
  const char* const footer =
      "Examples:\n"
      "  quadruped3d config show                                  what each profile stands for\n"
      "  quadruped3d config show -c my.json -c out/thresholds.json\n"
      "  quadruped3d config show -c my.json --set profile=strict --set guards.mask_iou_min=0.6\n"
      "  quadruped3d config schema > quadruped3d.schema.json\n"
      "  quadruped3d config schema training > training.schema.json\n"
      "The output of `show` is a config again and gives the same dataset. docs/config.md explains every key.";
  command->footer(footer);
  shown->footer(footer);
  return [arguments, schema, tables] {
    if (schema->parsed()) return print_schema(*arguments);
    return tables->parsed() ? make_tables(*arguments) : show(*arguments);
  };
}

}  // namespace q3d::pipeline::cli
