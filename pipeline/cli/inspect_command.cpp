#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
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
  command->add_option("--sample", arguments->sample, "print everything about the sample with this id");
  command->add_option("--sheet", arguments->sheet,
                      "write a PNG that shows crops with annotated and projected keypoints");
  command->add_option("--count", arguments->count, "number of samples on the sheet")
      ->capture_default_str()
      ->check(CLI::Range(1, 400));
  command->add_flag("--json", arguments->json, "print the description as JSON in one line");
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
    const nlohmann::ordered_json document =
        arguments->sample.empty() ? dataset::describe(arguments->path)
                                  : dataset::describe_sample(arguments->path, arguments->sample);
    fmt::print("{}\n", document.dump(arguments->json ? -1 : 2));
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
