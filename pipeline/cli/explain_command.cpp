#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
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
  CLI::App* command = declare(app, "explain");
  command->add_option("dataset", arguments->dataset, "a dataset's folder, or an output folder of `build`")
      ->required()
      ->check(CLI::ExistingPath);
  command
      ->add_option(
          "sample", arguments->sample,
          "the id of the sample, as in the first column of verdicts.csv, or a part of it that no other\n"
          "id has")
      ->required();
  json_flag(*command, arguments->json, "print the result as JSON");
  command->footer(
      "Examples:\n"
      "  quadruped3d explain out 'superanimal/train/images/wolf_1.jpg#12'\n"
      "  quadruped3d explain out wolf_1                                          a part of the id\n"
      "  quadruped3d explain out 'superanimal/train/images/wolf_1.jpg#12' --json | jq .curve\n"
      "The result has the source, the crop, the error of every keypoint, the course of adaptation, and the\n"
      "number that decided the verdict.\n"
      "The predictions of dropped candidates lie in OUT/stages. A dataset that was moved away from there\n"
      "can therefore explain less.\n"
      "To leave a sample out of the next build, write its id into a file and run build --veto FILE.");
  return [arguments] {
    const nlohmann::ordered_json story = dataset::explain(arguments->dataset, arguments->sample);
    fmt::print("{}", arguments->json ? story.dump() + "\n" : dataset::tell(story));
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
