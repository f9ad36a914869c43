#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "manifests/atomic_file.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/prediction/photographs_config.h"
#include "pipeline/prediction/predict_run.h"
#include "pipeline/prediction/predictions_file.h"
#include "pipeline/run/errors.h"
#include "pipeline/run/progress.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  std::filesystem::path photographs;
  prediction::PhotographOptions boxes;
  ConfigArguments config;
  prediction::PredictOptions options;
  bool json = false;
};

config::BuildConfig read_config(const Arguments& arguments) {
  const std::vector<std::string> settings = arguments.config.settings();
  if (arguments.photographs.empty()) return config::load_build_config(arguments.config.files, settings);
  return prediction::photographs_config(arguments.photographs, arguments.boxes, arguments.config.files,
                                        settings);
}

void print_summary(const prediction::PredictionSummary& summary, const std::filesystem::path& file) {
  const auto animals = static_cast<std::int64_t>(summary.animals.size());
  fmt::print(stderr, "\n{} of {} animals have a body, {} of them adapted, in {}\n", animals - summary.failed,
             animals, summary.adapted, run::human_duration(summary.seconds));
  constexpr int kListed = 10;
  int listed = 0;
  for (const prediction::PredictedAnimal& animal : summary.animals) {
    if (animal.failure == manifests::Reason::none || ++listed > kListed) continue;
    fmt::print(stderr, "  {}: {} ({})\n", animal.record.id, to_string(animal.failure), animal.detail);
  }
  if (listed > kListed) fmt::print(stderr, "  and {} more without one\n", listed - kListed);
  fmt::print(stderr, "wrote {}\n", file.string());
}

}  // namespace

Command add_predict(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "predict");
  command
      ->add_option("photographs", arguments->photographs,
                   "folder of photographs; without it, the config's datasets are predicted")
      ->check(CLI::ExistingDirectory);
  config_option(
      *command, arguments->config,
      "JSON config file that names the network; keys of a later file replace those of an earlier one")
      ->required();
  device_option(*command, arguments->config);
  out_option(*command, arguments->options.run.out, "output folder")->required();
  command
      ->add_option("-b,--boxes", arguments->boxes.boxes,
                   "boxes of the animals: a COCO file or MegaDetector's output. Without it, each\n"
                   "photograph is taken for one animal that fills it")
      ->check(CLI::ExistingFile);
  command->add_option("--min-score", arguments->boxes.min_score, "leave out boxes with a lower score")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  command->add_option("--species", arguments->boxes.species, "species of all animals, for the record");
  command
      ->add_option("--adapt", arguments->options.iterations,
                   "iterations of test-time adaptation, where the config's datasets have keypoints")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  threads_option(*command, arguments->options.run.threads);
  json_flag(*command, arguments->json);
  quiet_flag(*command, arguments->options.run.quiet);
  command->footer(
      "Examples:\n"
      "  quadruped3d predict photos/ --config network.json --out out/bodies\n"
      "  quadruped3d predict photos/ --boxes megadetector.json --min-score 0.5 -c network.json -o "
      "out/bodies\n"
      "  quadruped3d predict --config my.json --adapt 30 --out out/bodies    # datasets with keypoints\n"
      "network.json holds {\"network\": {\"checkpoint\": ..., \"smal_asset\": ...}}; the config of a build "
      "works\n"
      "too. The bodies are in OUT/predictions.json, one entry an animal; docs/predict.md describes it. "
      "Nothing\n"
      "is judged: whether a body is right can only be seen (overlay) or measured (build, with keypoints).");
  return [arguments] {
    const config::BuildConfig config = read_config(*arguments);
    const prediction::PredictionSummary summary = prediction::predict(config, arguments->options);
    const std::filesystem::path file = arguments->options.run.out / "predictions.json";
    manifests::write_file_atomically(file, prediction::predictions_document(summary).dump(1) + "\n");
    const auto animals = static_cast<std::int64_t>(summary.animals.size());
    print_summary(summary, file);
    if (arguments->json) {
      fmt::print("{}\n", nlohmann::ordered_json({{"animals", animals},
                                                 {"failed", summary.failed},
                                                 {"adapted", summary.adapted},
                                                 {"notes", summary.notes},
                                                 {"file", file.string()}})
                             .dump());
    }
    return summary.failed == animals ? 1 : 0;  // no body at all is a failure
  };
}

}  // namespace q3d::pipeline::cli
