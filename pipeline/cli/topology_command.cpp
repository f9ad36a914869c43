#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "loaders/keypoints/builtin_topologies.h"
#include "loaders/keypoints/topology_file.h"
#include "manifests/spelling.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/run/command_line.h"
#include "pipeline/run/errors.h"
#include "pipeline/run/words.h"
#include "pipeline/topology/topology_draft.h"

namespace q3d::pipeline::cli {
namespace {

namespace fs = std::filesystem;
namespace known = loaders::keypoints;

struct Arguments {
  topology::DraftOptions draft;
  topology::SheetOptions sheet;
  std::string shown;
  bool lists = false;
  bool json = false;
};

int list_builtin(bool json) {
  nlohmann::ordered_json document = nlohmann::ordered_json::array();
  for (const known::BuiltinTopology& each : known::builtin_topologies()) {
    const auto about = nlohmann::json::parse(each.text);
    const auto count = static_cast<std::int64_t>(about["keypoints"].size());
    document.push_back({{"name", each.name}, {"keypoints", about["keypoints"]}, {"about", about["about"]}});
    if (!json)
      fmt::print("{:<24}{:<14}{}\n", each.name, run::counted(count, "keypoint"),
                 about["about"].get<std::string>());
  }
  if (json) fmt::print("{}\n", document.dump());
  return 0;
}

int show_builtin(const std::string& name) {
  std::vector<std::string> names;
  for (const known::BuiltinTopology& each : known::builtin_topologies()) {
    if (each.name == name) {
      fmt::print("{}", each.text);
      return 0;
    }
    names.emplace_back(each.name);
  }
  throw run::ConfigError(fmt::format("topology --show: \"{}\" is no built-in topology{}; they are {}", name,
                                     manifests::suggestion(name, names), fmt::join(names, ", ")));
}

// Prints the guessed topology and all doubts.
void print_draft(const topology::Draft& draft, const fs::path& out) {
  const auto count = static_cast<std::int64_t>(draft.guess.topology.keypoints.size());
  fmt::print(stderr, "{} ({}): {}\n", draft.survey.file.string(), draft.survey.kind,
             run::counted(count, "keypoint name"));
  for (const std::string& note : draft.survey.notes) fmt::print(stderr, "note: {}\n", note);
  if (!draft.guess.doubts.empty()) {
    fmt::print(stderr, "{} to look at:\n",
               run::counted(static_cast<std::int64_t>(draft.guess.doubts.size()), "thing"));
  }
  for (const std::string& doubt : draft.guess.doubts) fmt::print(stderr, "  - {}\n", doubt);
  if (!out.empty()) fmt::print(stderr, "wrote {}\n", out.string());
}

int draw_sheet(const Arguments& arguments, const fs::path& topology) {
  topology::SheetOptions options = arguments.sheet;
  options.labels = arguments.draft.from;
  options.topology = topology;
  for (const auto& note : topology::draw_label_sheet(options)) fmt::print(stderr, "note: {}\n", note.text);
  fmt::print(stderr, "wrote {}: left is blue, right is orange\n", options.sheet.string());
  return 0;
}

int run(const Arguments& arguments) {
  if (arguments.lists) return list_builtin(arguments.json);
  if (!arguments.shown.empty()) return show_builtin(arguments.shown);
  const fs::path& from = arguments.draft.from;
  const fs::path& out = arguments.draft.out;
  if (from.empty()) throw run::ConfigError("topology: give --from FILE, --list or --show NAME");
  if (!arguments.sheet.topology.empty()) {
    if (arguments.sheet.sheet.empty() || !out.empty()) {
      throw run::ConfigError(
          "topology: --topology draws a --sheet with a topology that exists, and writes no --out");
    }
    return draw_sheet(arguments, arguments.sheet.topology);
  }
  if (!arguments.sheet.sheet.empty() && out.empty()) {
    throw run::ConfigError("topology: --sheet needs a topology: --out for the guessed one, or --topology");
  }
  const topology::Draft draft = topology::draft_topology(arguments.draft);
  print_draft(draft, out);
  if (out.empty()) fmt::print("{}", draft.text);
  if (!arguments.sheet.sheet.empty()) return draw_sheet(arguments, out);
  if (!out.empty() && !draft.survey.format.empty()) {
    std::vector<std::string> words{"topology", "--from", from.string(), "--topology", out.string()};
    if (!draft.images.empty()) words.insert(words.end(), {"--images", draft.images.string()});
    words.insert(words.end(), {"--sheet", "sheet.png"});
    fmt::print(stderr, "next: {}\n", run::command_line(words));
  }
  return 0;
}

}  // namespace

Command add_topology(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "topology");
  command
      ->add_option("--from", arguments->draft.from,
                   "label file whose names to read: COCO or LabelMe .json; DeepLabCut, SLEAP or Lightning "
                   "Pose .h5, .slp or .csv; or a folder of labels")
      ->check(CLI::ExistingPath);
  out_file_option(*command, arguments->draft.out,
                  "write the topology to this file; without it, it is printed");
  command->add_flag("--force", arguments->draft.replaces, "write over a file that is there");
  command->add_option("--name", arguments->draft.name,
                      "name of the topology, instead of the label file's name");
  command->add_option("--sheet", arguments->sheet.sheet,
                      "write a PNG of a few labelled animals: left in blue, right in orange, with names");
  command->add_option("--topology", arguments->sheet.topology,
                      "draw the sheet with this topology: a file, or the name of a built-in one");
  command->add_option("--root", arguments->sheet.root,
                      "folder of the pictures' names, instead of the label file's folder");
  command->add_option("--images", arguments->sheet.images, "folder of the pictures, relative to the root");
  command->add_option("--count", arguments->sheet.count, "number of animals on the sheet")
      ->capture_default_str()
      ->check(CLI::Range(1, 60));
  command->add_flag("--list", arguments->lists, "list the built-in topologies");
  command->add_option("--show", arguments->shown, "print a built-in topology, as a start for a file");
  json_flag(*command, arguments->json, "with --list: print the list as JSON");
  command->footer(
      "Examples:\n"
      "  quadruped3d topology --list\n"
      "  quadruped3d topology --from field.json --out goats.json\n"
      "  quadruped3d topology --from goats --out goats.json --sheet sheet.png     a DeepLabCut project\n"
      "  quadruped3d topology --from clip.slp --out mice.json --sheet sheet.png --images frames\n"
      "  quadruped3d topology --from field.json --topology goats.json --sheet sheet.png --images frames\n"
      "The command reads the names of the keypoints, guesses which are mirror images and which of the 26\n"
      "keypoints they are, and prints every doubt. Correct the file, draw the sheet, and look whether left\n"
      "is left. In a config, a topology is a file or the name of a built-in one: \"topology\": \"ap10k\".\n"
      "docs/own-labels.md goes through an example.");
  return [arguments] { return run(*arguments); };
}

}  // namespace q3d::pipeline::cli
