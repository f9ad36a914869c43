#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/dataset/inspect.h"
#include "pipeline/report/contact_sheet.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  std::filesystem::path path;
  std::string sample;
  std::filesystem::path sheet;
  int count = 24;
  bool json = false;
};

}  // namespace

Command add_inspect(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "inspect");
  command->add_option("path", arguments->path, "a dataset's folder, an output folder, or one shard")
      ->required()
      ->check(CLI::ExistingPath);
  command->add_option("--sample", arguments->sample, "describe the sample with this id, or a part of an id");
  command->add_option("--sheet", arguments->sheet,
                      "write a PNG that shows crops with annotated and projected keypoints");
  command->add_option("--count", arguments->count, "number of samples on the sheet")
      ->capture_default_str()
      ->check(CLI::Range(1, 400));
  json_flag(*command, arguments->json, "print everything that is known as JSON in one line");
  command->footer(
      "Examples:\n"
      "  quadruped3d inspect out\n"
      "  quadruped3d inspect out --sheet sheet.png --count 36\n"
      "  quadruped3d inspect out/latest/shards/000000.h5 --sample 'superanimal/test/images/wolf_1.jpg#12'\n"
      "On the sheet, green discs are the annotated keypoints and red crosses are those of the labelled\n"
      "body.");
  return [arguments] {
    if (!arguments->sheet.empty()) {
      report::write_contact_sheet(arguments->sheet,
                                  dataset::spread_samples(arguments->path, arguments->count));
      fmt::print(stderr, "wrote {}\n", arguments->sheet.string());
      return 0;
    }
    const bool is_whole = arguments->sample.empty();
    if (arguments->json) {
      const nlohmann::ordered_json document =
          is_whole ? dataset::describe(arguments->path)
                   : dataset::describe_sample(arguments->path, arguments->sample);
      fmt::print("{}\n", document.dump());
    } else {
      fmt::print("{}", is_whole ? dataset::page(arguments->path)
                                : dataset::sample_page(arguments->path, arguments->sample));
    }
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
