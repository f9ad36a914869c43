#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/network/torch_bodies.h"
#include "pipeline/report/overlay_run.h"
#include "pipeline/run/errors.h"
#include "pipeline/run/log.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  report::OverlayOptions options;
  std::vector<std::string> panels;
  std::size_t worst = 0;
  std::size_t best = 0;
  std::size_t near_threshold = 0;
  bool plain = false;
  ConfigArguments config;
  bool json = false;
};

void order_options(CLI::App& command, Arguments& arguments) {
  report::Choice& choice = arguments.options.choice;
  CLI::Option* worst = command.add_option("--worst", arguments.worst,
                                          "the N labels of largest L_proj (of --verdict, if that is given)");
  CLI::Option* best = command.add_option("--best", arguments.best, "the N labels of smallest L_proj");
  CLI::Option* near = command.add_option("--near-threshold", arguments.near_threshold,
                                         "the N candidates whose prediction is nearest to a threshold");
  for (CLI::Option* option : {worst, best, near}) option->type_name("N")->check(CLI::Range(1, 10000));
  worst->excludes(best)->excludes(near);
  best->excludes(near);
  command
      .add_option("--count", choice.count, "at most so many candidates, spread evenly, without those options")
      ->capture_default_str()
      ->check(CLI::Range(1, 10000));
}

void filter_options(CLI::App& command, report::Choice& choice) {
  command.add_option("--verdict", choice.verdicts, "only these verdicts or reasons")
      ->delimiter(',')
      ->allow_extra_args(false);
  command.add_option("--species", choice.species, "only these species, as verdicts.csv names them")
      ->delimiter(',')
      ->allow_extra_args(false);
  command.add_option("--family", choice.families, "only these families")
      ->delimiter(',')
      ->allow_extra_args(false);
  command.add_option("--dataset-name", choice.datasets, "only candidates of these datasets of the config")
      ->delimiter(',')
      ->allow_extra_args(false);
}

void output_options(CLI::App& command, Arguments& arguments) {
  report::OverlayOptions& options = arguments.options;
  out_option(command, options.folder, "folder for one PNG per candidate");
  command.add_option("--sheet", options.sheet, "one PNG with all chosen candidates");
  command.add_option("--columns", options.columns, "columns of the sheet")
      ->capture_default_str()
      ->check(CLI::Range(1, 100));
  command
      .add_option("--panels", arguments.panels,
                  "panels to draw: photo, prediction, label, side, keypoints (default: all)")
      ->delimiter(',')
      ->allow_extra_args(false);
  command.add_flag("--plain", arguments.plain, "draw the panels without captions");
  command.add_flag("--obj", options.obj, "also write each body as Wavefront OBJ");
  command.add_flag("--glb", options.glb, "also write each body as binary glTF");
  config_option(command, arguments.config,
                "the build's config, if pictures or the body model are not found without it");
  command.add_option("--body", options.body, "body model (default: the one that the dataset was made with)")
      ->check(CLI::ExistingFile);
  json_flag(command, arguments.json, "print the ids that were drawn as JSON");
}

// Converts the words of the command line to the library's options.
report::OverlayOptions options_of(Arguments arguments) {
  report::OverlayOptions options = std::move(arguments.options);
  const auto order = [&](report::Order kind, std::size_t count) {
    if (count == 0) return;
    options.choice.order = kind;
    options.choice.count = count;
    if (kind != report::Order::near_threshold && options.choice.verdicts.empty()) {
      options.choice.verdicts = {"retained", "refined"};
    }
  };
  order(report::Order::worst, arguments.worst);
  order(report::Order::best, arguments.best);
  order(report::Order::near_threshold, arguments.near_threshold);
  options.captions = !arguments.plain;
  if (!arguments.config.files.empty()) {
    options.config = config::load_build_config(arguments.config.files, arguments.config.settings());
  }
  if (arguments.panels.empty()) return options;
  options.panels.clear();
  for (const std::string& name : arguments.panels) {
    try {
      options.panels.push_back(report::panel_from_string(name));
    } catch (const std::invalid_argument& error) {
      throw run::ConfigError(fmt::format("--panels: {}", error.what()));
    }
  }
  return options;
}

int run(const Arguments& arguments) {
  const report::OverlayOptions options = options_of(arguments);
  const report::OverlaySummary summary = report::draw_overlays(options, network::load_body_meshes);
  for (const std::string& id : summary.without_body) run::log_note(id + ": it has no body to write");
  fmt::print(stderr, "{} candidates, {} files\n", summary.ids.size(), summary.files);
  for (const std::filesystem::path& place : {options.folder, options.sheet}) {
    if (!place.empty()) fmt::print(stderr, "wrote {}\n", place.string());
  }
  if (arguments.json) {
    nlohmann::ordered_json drawn = nlohmann::ordered_json::array();
    for (const std::string& id : summary.ids) drawn.push_back({{"id", id}, {"stem", report::file_stem(id)}});
    fmt::print("{}\n", drawn.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  }
  return 0;
}

}  // namespace

Command add_overlay(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "overlay");
  command
      ->add_option("dataset", arguments->options.dataset,
                   "a dataset's folder, or an output folder of `build`")
      ->required()
      ->check(CLI::ExistingPath);
  command->add_option("ids", arguments->options.choice.ids,
                      "ids of candidates, or parts of ids; without them, of all candidates");
  order_options(*command, *arguments);
  filter_options(*command, arguments->options.choice);
  output_options(*command, *arguments);
  command->footer(
      "Examples:\n"
      "  quadruped3d overlay out 'superanimal/train/images/wolf_1.jpg#12' --out overlays --glb\n"
      "  quadruped3d overlay out wolf_1.jpg --sheet wolf.png\n"
      "  quadruped3d overlay out --worst 20 --sheet worst.png\n"
      "  quadruped3d overlay out --near-threshold 12 --species lion,tiger --out overlays\n"
      "  quadruped3d overlay out --verdict gain_too_small --count 30 --sheet dropped.png\n"
      "  quadruped3d overlay out --best 6 --panels label --plain --columns 6 --sheet row.png\n"
      "The panels show the photograph, the network's prediction (blue), the label (orange; of a discarded\n"
      "candidate, the body that adaptation ended with), the same body from the side, and the keypoints with\n"
      "their errors. Kept candidates are drawn from the shards, the others from the source pictures, which\n"
      "are found by their digests where the build read them.");
  return [arguments] { return run(*arguments); };
}

}  // namespace q3d::pipeline::cli
