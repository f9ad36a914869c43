#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/exports/corrections.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  std::filesystem::path folder;
  std::filesystem::path corrected;
  std::filesystem::path out;
  bool json = false;
};

}  // namespace

Command add_corrections(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "corrections");
  command->add_option("export", arguments->folder, "folder of an export in the format coco")
      ->required()
      ->check(CLI::ExistingDirectory);
  command
      ->add_option("corrected", arguments->corrected, "the COCO file that came back from an annotation tool")
      ->required()
      ->check(CLI::ExistingFile);
  out_option(*command, arguments->out, "folder for corrections.tsv and veto.txt")->required();
  json_flag(*command, arguments->json);
  command->footer(
      "Example:\n"
      "  quadruped3d export out --format coco --out exports/coco\n"
      "  (move points, and delete the annotations of bad samples, in CVAT, FiftyOne or another tool)\n"
      "  quadruped3d corrections exports/coco corrected.json --out changes\n"
      "  quadruped3d build -c my.json -o out --corrections changes/corrections.tsv --veto changes/veto.txt\n"
      "Pictures that the file does not list stay as they were. docs/export.md describes the round trip.");
  return [arguments] {
    const exports::CocoChanges changes = exports::coco_changes(arguments->folder, arguments->corrected);
    exports::write_changes(changes, arguments->out);
    std::size_t points = 0;
    for (const auto& [id, corrected] : changes.points) points += corrected.size();
    fmt::print(stderr,
               "{} pictures compared: {} keypoints of {} samples corrected, {} samples vetoed\n  {}\n  {}\n",
               changes.pictures, points, changes.points.size(), changes.vetoes.size(),
               (arguments->out / "corrections.tsv").string(), (arguments->out / "veto.txt").string());
    fmt::print(stderr, "next: quadruped3d build with the config of before and --corrections {} --veto {}\n",
               (arguments->out / "corrections.tsv").string(), (arguments->out / "veto.txt").string());
    if (arguments->json) {
      const nlohmann::ordered_json document = {{"pictures", changes.pictures},
                                               {"corrected_samples", changes.points.size()},
                                               {"corrected_keypoints", points},
                                               {"vetoed", changes.vetoes.size()}};
      fmt::print("{}\n", document.dump());
    }
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
