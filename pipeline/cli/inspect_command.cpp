#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/inspect_command.h"
#include "pipeline/cli/options.h"
#include "pipeline/dataset/inspect.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  report::SheetOptions sheet;
  std::string sample;
  bool json = false;
};

int draw_sheet(const report::SheetOptions& options, const device::BodyMeshesLoader& load_bodies) {
  if (!load_bodies) throw std::logic_error("inspect --sheet runs in quadruped3d-network");
  report::write_contact_sheet(options, load_bodies);
  fmt::print(stderr, "wrote {}\n", options.out.string());
  return 0;
}

}  // namespace

Command add_inspect(CLI::App& app) {
  return add_inspect_with(app, {});
}

Command add_inspect_with(CLI::App& app, const device::BodyMeshesLoader& load_bodies) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "inspect");
  command->add_option("path", arguments->sheet.path, "a dataset's folder, an output folder, or one shard")
      ->required()
      ->check(CLI::ExistingPath);
  command->add_option("--sample", arguments->sample, "describe the sample with this id, or a part of an id");
  command->add_option("--sheet", arguments->sheet.out,
                      "write a PNG that shows crops with the labels' meshes and keypoints");
  command
      ->add_option("--body", arguments->sheet.body,
                   "body model of the sheet's meshes (default: the one that the dataset was made with)")
      ->check(CLI::ExistingFile);
  command->add_option("--count", arguments->sheet.count, "number of samples on the sheet")
      ->capture_default_str()
      ->check(CLI::Range(1, 400));
  json_flag(*command, arguments->json, "print everything that is known as JSON in one line");
  command->footer(
      "Examples:\n"
      "  quadruped3d inspect out\n"
      "  quadruped3d inspect out --sheet sheet.png --count 36\n"
      "  quadruped3d inspect out/latest/shards/000000.h5 --sample 'superanimal/test/images/wolf_1.jpg#12'\n"
      "On the sheet, meshes are the labels, discs the annotated keypoints with the bones between them (blue\n"
      "left, orange right), and yellow crosses the keypoints of the label. `quadruped3d overlay` draws the\n"
      "discarded candidates too.");
  return [arguments, load_bodies] {
    if (!arguments->sheet.out.empty()) return draw_sheet(arguments->sheet, load_bodies);
    const bool is_whole = arguments->sample.empty();
    if (arguments->json) {
      const nlohmann::ordered_json document =
          is_whole ? dataset::describe(arguments->sheet.path)
                   : dataset::describe_sample(arguments->sheet.path, arguments->sample);
      fmt::print("{}\n", document.dump());
    } else {
      fmt::print("{}", is_whole ? dataset::page(arguments->sheet.path)
                                : dataset::sample_page(arguments->sheet.path, arguments->sample));
    }
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
