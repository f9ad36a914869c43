#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/dataset/explain.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  std::filesystem::path dataset;
  std::string sample;
  bool json = false;
};

}  // namespace

Command add_explain(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("explain", "one candidate's whole story, and why it ended as it did");
  command->add_option("dataset", arguments->dataset, "a dataset's folder, or an output folder of `build`")
      ->required()
      ->check(CLI::ExistingPath);
  command->add_option("sample", arguments->sample, "its id, as in the first column of verdicts.csv")
      ->required();
  command->add_flag("--json", arguments->json, "print it as JSON on stdout");
  command->footer(
      "Examples:\n"
      "  quadruped3d explain out 'superanimal/train/images/wolf_1.jpg#12'\n"
      "  quadruped3d explain out 'superanimal/train/images/wolf_1.jpg#12' --json | jq .curve\n"
      "It tells the source, the crop, the error of every keypoint, the course of adaptation, and which "
      "number "
      "decided.\n"
      "Predictions of what was not kept lie in OUT/stages, so a dataset that was moved away from there tells "
      "less.\n"
      "To leave a sample out of the next build, put its id on a line of a file: build --veto FILE.");
  return [arguments] {
    const nlohmann::ordered_json story = dataset::explain(arguments->dataset, arguments->sample);
    fmt::print("{}", arguments->json ? story.dump() + "\n" : dataset::tell(story));
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
