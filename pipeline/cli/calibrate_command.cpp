#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "manifests/atomic_file.h"
#include "pipeline/build/calibrate_run.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/report/calibration_figure.h"
#include "pipeline/run/command_line.h"
#include "pipeline/run/progress.h"
#include "pipeline/run/words.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  ConfigArguments config;
  run::RunOptions run;
  std::filesystem::path write;
  std::filesystem::path figure;
  bool json = false;
};

void print_pool(const filters::CalibratedPool& pool) {
  const filters::Calibration& result = pool.calibration;
  fmt::print(stderr, "\n{}: {} with a prediction, of which {} adapted\n",
             pool.dataset.empty() ? "all datasets" : pool.dataset, run::counted(pool.judged, "candidate"),
             run::counted(pool.adapted, "was", "were"));
  fmt::print(stderr, "{}", report::calibration_table(pool));
  fmt::print(stderr, "  retained {:.1f} %, refined {:.1f} %, discarded {:.1f} %\n", 100 * result.retained,
             100 * result.refined, 100 * (1 - result.retained - result.refined));
  if (!result.reached) {
    fmt::print(
        stderr,
        "  warning: too few candidates reach delta = {}, so the refined share that you asked for cannot be\n"
        "  met; these thresholds come closest. A larger tta.learning_rate or a smaller delta lets more\n"
        "  candidates pass.\n",
        result.thresholds.delta);
  }
}

void print_summary(const build::CalibrationSummary& summary, const Arguments& arguments) {
  fmt::print(stderr, "\ncalibrated on {} in {}\n", run::counted(summary.candidates, "candidate"),
             run::human_duration(summary.seconds));
  for (const filters::CalibratedPool& pool : summary.pools) print_pool(pool);
  for (const dataset::Warning& warning : summary.warnings) {
    fmt::print(stderr, "WARNING: {}\n", warning.message);
  }
  fmt::print(stderr, "\n");
  fmt::print("{}", build::thresholds_layer(summary));
  if (!arguments.figure.empty()) fmt::print(stderr, "wrote {}\n", arguments.figure.string());
  if (!arguments.write.empty()) {
    std::vector<std::string> words{"build"};
    const std::vector<std::string> config = arguments.config.words();
    words.insert(words.end(), config.begin(), config.end());
    words.insert(words.end(), {"--config", arguments.write.string(), "--out", arguments.run.out.string()});
    fmt::print(stderr, "next: {}\n", run::command_line(words));
  }
}

nlohmann::ordered_json to_json(const build::CalibrationSummary& summary) {
  nlohmann::ordered_json pools = nlohmann::ordered_json::array();
  std::int64_t judged = 0;
  std::int64_t adapted = 0;
  for (const filters::CalibratedPool& pool : summary.pools) {
    judged += pool.judged;
    adapted += pool.adapted;
    const filters::Calibration& result = pool.calibration;
    nlohmann::ordered_json curve = nlohmann::ordered_json::array();
    for (const filters::YieldPoint& point : pool.curve) {
      curve.push_back({{"tau", point.tau}, {"yield", point.yield}, {"auc", point.auc}});
    }
    nlohmann::ordered_json entry = {{"tau_low", result.thresholds.tau_low},
                                    {"tau_high", result.thresholds.tau_high},
                                    {"delta", result.thresholds.delta},
                                    {"judged", pool.judged},
                                    {"adapted", pool.adapted},
                                    {"retained_share", result.retained},
                                    {"refined_share", result.refined},
                                    {"reached", result.reached},
                                    {"curve", std::move(curve)}};
    entry["dataset"] = nullptr;
    if (!pool.dataset.empty()) entry["dataset"] = pool.dataset;
    pools.push_back(std::move(entry));
  }
  return {{"candidates", summary.candidates},
          {"judged", judged},
          {"adapted", adapted},
          {"pools", std::move(pools)},
          {"warnings", dataset::to_json(summary.warnings)}};
}

}  // namespace

Command add_calibrate(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  arguments->run.shares_units = true;
  CLI::App* command = declare(app, "calibrate");
  config_option(*command, arguments->config)->required();
  device_option(*command, arguments->config);
  out_option(*command, arguments->run.out, "output folder; a later build in it reuses the predictions")
      ->required();
  command->add_option("-w,--write", arguments->write,
                      "write the thresholds to this file, which build takes as a second --config");
  command->add_option("-f,--figure", arguments->figure,
                      "write an SVG figure of yield and AUC against the threshold");
  ranks_option(*command);
  threads_option(*command, arguments->run.threads);
  above_ceiling_flag(*command, arguments->run.above_ceiling);
  json_flag(*command, arguments->json);
  quiet_flag(*command, arguments->run.quiet);
  command->footer(
      "Examples:\n"
      "  quadruped3d calibrate --config my.json --out out --write out/thresholds.json \\\n"
      "      --figure out/thresholds.svg\n"
      "  quadruped3d build --config my.json --config out/thresholds.json --out out\n"
      "The config's \"calibrate\": {\"retained\", \"refined\"} sets the shares. The default shares are the\n"
      "paper's (of 14K candidates, 5K retained, 4K refined, 5K discarded). delta stays as the config has\n"
      "it. With \"per_dataset\": true every dataset gets thresholds of its own. Guards that bound labels\n"
      "act later and lower the shares.");
  return [arguments] {
    const build::CalibrationSummary summary = build::calibrate(
        config::load_build_config(arguments->config.files, arguments->config.settings()), arguments->run);
    if (summary.rank != 0) return 0;  // rank 0 reports for all
    if (!arguments->write.empty()) build::write_thresholds(arguments->write, summary);
    if (!arguments->figure.empty()) {
      manifests::write_file_atomically(arguments->figure, report::calibration_figure(summary.pools));
    }
    if (arguments->json) {
      fmt::print("{}\n", to_json(summary).dump());
    } else {
      print_summary(summary, *arguments);
    }
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
