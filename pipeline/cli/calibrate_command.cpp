#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "pipeline/calibrate_run.h"
#include "pipeline/cli/commands.h"
#include "pipeline/progress.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  std::vector<std::filesystem::path> configs;
  RunOptions run;
  std::filesystem::path write;
  bool json = false;
};

void print_summary(const CalibrationSummary& summary, const std::filesystem::path& written) {
  const filters::Calibration& result = summary.calibration;
  fmt::print(stderr, "\ncalibrated in {}: {} of {} candidates have a prediction, {} were adapted\n",
             human_duration(summary.seconds), summary.judged, summary.candidates, summary.adapted);
  fmt::print(stderr, "  retained {:.1f} %, refined {:.1f} %, discarded {:.1f} % of the judged\n",
             100 * result.retained, 100 * result.refined, 100 * (1 - result.retained - result.refined));
  if (!result.reached) {
    fmt::print(stderr,
               "  warning: too few candidates reach delta = {} to give the refined share that was asked for; "
               "this is\n"
               "  the closest. A larger tta.learning_rate or a smaller delta lets more through.\n",
               result.thresholds.delta);
  }
  fmt::print("\"filter\": {{\"tau_low\": {}, \"tau_high\": {}, \"delta\": {}}}\n", result.thresholds.tau_low,
             result.thresholds.tau_high, result.thresholds.delta);
  if (!written.empty()) {
    fmt::print(stderr, "next: quadruped3d build --config <the same> --config {} --out <the same>\n",
               written.string());
  }
}

nlohmann::ordered_json to_json(const CalibrationSummary& summary) {
  const filters::Calibration& result = summary.calibration;
  return {{"tau_low", result.thresholds.tau_low},
          {"tau_high", result.thresholds.tau_high},
          {"delta", result.thresholds.delta},
          {"candidates", summary.candidates},
          {"judged", summary.judged},
          {"adapted", summary.adapted},
          {"retained_share", result.retained},
          {"refined_share", result.refined},
          {"reached", result.reached}};
}

}  // namespace

Command add_calibrate(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("calibrate", "thresholds for a pool and a network, from the shares wanted");
  command->add_option("-c,--config", arguments->configs, "JSON config; a second one is laid over the first")
      ->required()
      ->check(CLI::ExistingFile);
  command
      ->add_option("-o,--out", arguments->run.out, "output folder; a later build there finds the predictions")
      ->required();
  command->add_option("-w,--write", arguments->write, "write the thresholds as a config layer");
  command->add_option("-t,--threads", arguments->run.threads, "threads that read and decode (0 = all cores)")
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--json", arguments->json, "print a machine-readable summary on stdout");
  command->add_flag("-q,--quiet", arguments->run.quiet, "no progress");
  command->footer(
      "Examples:\n"
      "  quadruped3d calibrate --config my.json --out out --write out/thresholds.json\n"
      "  quadruped3d build --config my.json --config out/thresholds.json --out out\n"
      "The shares are the config's \"calibrate\": {\"retained\", \"refined\"}; by default those of the "
      "paper\n"
      "(14K candidates: 5K retained, 4K refined, 5K discarded). delta is taken as given.");
  return [arguments] {
    const CalibrationSummary summary = calibrate(load_build_config(arguments->configs), arguments->run);
    if (!arguments->write.empty()) write_thresholds(arguments->write, summary.calibration.thresholds);
    if (arguments->json) {
      fmt::print("{}\n", to_json(summary).dump());
    } else {
      print_summary(summary, arguments->write);
    }
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
