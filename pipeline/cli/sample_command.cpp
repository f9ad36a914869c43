#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/run/interrupt.h"
#include "pipeline/run/progress.h"
#include "pipeline/run/words.h"
#include "pipeline/world/world.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  world::WorldOptions world;
  bool json = false;
  bool quiet = false;
};

}  // namespace

Command add_sample(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  world::WorldOptions& options = arguments->world;
  CLI::App* command = declare(app, "sample");
  out_option(*command, options.out, "folder to create")->required();
  command->add_option("--seed", options.seed, "the same seed gives the same bytes")->capture_default_str();
  command->add_option("--share", options.share, "share of the default number of pictures to render")
      ->capture_default_str();
  command->add_option("--pixels", options.picture_px, "longer side of a photograph, in pixels")
      ->capture_default_str();
  threads_option(*command, options.threads,
                 "number of threads (0 = all cores); it does not change the result");
  json_flag(*command, arguments->json);
  quiet_flag(*command, arguments->quiet);
  command->footer(
      "Examples:\n"
      "  quadruped3d sample --out data/world --share 0.08     a few hundred pictures\n"
      "  quadruped3d sample --out data/world                  the whole world, 5,000 pictures\n"
      "The folders animal3d/, control_animal3dlatest/, superanimal_quadruped/ and animal_kingdom/ have the\n"
      "layouts of these datasets. truth/ has the hidden truth of the two sets that have 2D keypoints only,\n"
      "and assets/ has the synthetic SMAL asset. docs/synthetic-world.md describes the world.");
  return [arguments] {
    world::WorldOptions& wanted = arguments->world;
    std::unique_ptr<run::Progress> progress;
    int shown = 0;
    wanted.progress = [&](int done, int total) {
      run::throw_if_interrupted();
      if (!progress) progress = std::make_unique<run::Progress>("pictures", total, arguments->quiet);
      progress->advance(done - shown);
      shown = done;
    };
    const world::WorldSummary summary = world::make_world(wanted);
    progress.reset();
    for (const auto& [name, count] : summary.pictures) fmt::print(stderr, "  {:<28} {:>6}\n", name, count);
    fmt::print(stderr, "{} in {}{}\n", run::counted(summary.total, "picture"), wanted.out.string(),
               summary.reused ? " (they existed already)" : "");
    if (arguments->json) {
      const nlohmann::ordered_json document = {
          {"pictures", summary.pictures}, {"total", summary.total}, {"smal_asset", summary.asset.string()}};
      fmt::print("{}\n", document.dump());
    }
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
