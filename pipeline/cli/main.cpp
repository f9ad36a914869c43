// quadruped3d: the one program. Parses the command line, runs one subcommand, turns exceptions into exit
// codes.

#include <fmt/format.h>

#include <opencv2/core.hpp>

#include <cstdio>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/cli/commands.h"
#include "pipeline/run/errors.h"
#include "pipeline/run/interrupt.h"
#include "pipeline/run/version.h"

namespace {

constexpr int kFailure = 1;
constexpr int kUsage = 2;
constexpr int kInterrupted = 130;

int run(int argc, char** argv) {
  namespace cli = q3d::pipeline::cli;
  CLI::App app{
      "Builds 3D datasets of quadrupeds: it adds pseudo-3D labels (SMAL pose, shape, camera) to photographs\n"
      "that have 2D keypoints, and records for every label how it was made and why it was kept or dropped."};
  app.name("quadruped3d");
  app.require_subcommand(1);
  app.set_version_flag("--version", "quadruped3d " + std::string(q3d::pipeline::run::version()));
  app.footer(
      "First steps:\n"
      "  quadruped3d sample --out data/world                 render pictures to try the program with\n"
      "  quadruped3d init --size small --out data/small.safetensors\n"
      "  quadruped3d calibrate --config configs/sample.json --out out --write out/thresholds.json\n"
      "  quadruped3d build --config configs/sample.json --config out/thresholds.json --out out\n"
      "  quadruped3d verify out\n"
      "`quadruped3d COMMAND --help` explains a command with examples.");
  const std::vector<std::pair<std::string, cli::Command>> commands = {
      {"build", cli::add_build(app)},
      {"calibrate", cli::add_calibrate(app)},
      {"verify", cli::add_verify(app)},
      {"inspect", cli::add_inspect(app)},
      {"sample", cli::add_sample(app)},
      {"init", cli::add_init(app)},
      {"train", cli::add_train(app)},
      {"evaluate", cli::add_evaluate(app)},
      {"compare", cli::add_compare(app)},
      {"evaluate-labels", cli::add_evaluate_labels(app)},
      {"compare-labels", cli::add_compare_labels(app)},
      {"config", cli::add_config(app)},
      {"explain", cli::add_explain(app)},
      {"leakage", cli::add_leakage(app)},
      {"curate", cli::add_curate(app)},
  };
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kUsage;
  }
  for (const auto& [name, command] : commands) {
    if (app.got_subcommand(name)) return command();
  }
  return kUsage;
}

}  // namespace

int main(int argc, char** argv) {
  cv::setNumThreads(1);  // the flow graph's threads are the only ones
  q3d::pipeline::run::install_interrupt_handlers();
  try {
    return run(argc, argv);
  } catch (const q3d::pipeline::run::Interrupted&) {
    fmt::print(stderr, "stopped; run the same command to continue\n");
    return kInterrupted;
  } catch (const q3d::pipeline::run::ConfigError& error) {
    fmt::print(stderr, "quadruped3d: {}\n", error.what());
    return kUsage;
  } catch (const std::bad_alloc&) {
    fmt::print(stderr,
               "quadruped3d: out of memory; use a smaller network.batch, tta.batch or shards.unit_size\n");
    return kFailure;
  } catch (const std::exception& error) {
    fmt::print(stderr, "quadruped3d: {}\n", error.what());
    return kFailure;
  }
}
