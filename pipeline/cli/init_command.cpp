#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "pipeline/animal/synthetic_files.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/network/torch_network.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  std::filesystem::path out;
  std::filesystem::path asset;
  std::filesystem::path priors;
  std::filesystem::path stem;
  std::string size = "small";
  std::uint64_t seed = 0;
  bool json = false;
};

}  // namespace

Command add_init(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "init");
  out_file_option(*command, arguments->out, "write an untrained checkpoint to this file (safetensors)");
  command
      ->add_option("-s,--size", arguments->size,
                   "size of the network: vith (the paper's), small, lite or tiny")
      ->capture_default_str();
  command->add_option("--stem", arguments->stem,
                      "start the EfficientNet of a network of size lite from the weights in this file\n"
                      "(tools/import_stem.py writes such a file)");
  command->add_option("--seed", arguments->seed, "the same seed gives the same bytes")->capture_default_str();
  command->add_option("--smal-asset", arguments->asset,
                      "write the synthetic quadruped, a body model with SMAL's dimensions, to this file");
  command->add_option("--priors", arguments->priors,
                      "write the synthetic quadruped's pose and shape priors, for training, to this file");
  json_flag(*command, arguments->json);
  command->footer(
      "Examples:\n"
      "  quadruped3d init --size small --out data/small.safetensors \\\n"
      "      --smal-asset data/smal_synthetic.safetensors\n"
      "  quadruped3d init --size lite --stem models/efficientnet_lite0.safetensors \\\n"
      "      --out data/lite.safetensors\n"
      "  quadruped3d init --size vith --seed 7 --out data/vith.safetensors\n"
      "An untrained network predicts nothing useful. It is a start for training, or a way to try the\n"
      "program at any size. SMAL itself must not be redistributed; the synthetic quadruped has its\n"
      "dimensions.");
  return [arguments] {
    if (arguments->out.empty() && arguments->asset.empty() && arguments->priors.empty()) {
      throw run::ConfigError(
          "init: give at least one of --out (a checkpoint), --smal-asset (the body) and --priors");
    }
    if (!arguments->stem.empty() && arguments->out.empty()) {
      throw run::ConfigError("init: --stem goes into the checkpoint that --out names; give --out");
    }
    nlohmann::ordered_json document = nlohmann::ordered_json::object();
    if (!arguments->out.empty()) {
      network::write_initial_checkpoint(arguments->out, arguments->size, arguments->seed, arguments->stem);
      const std::string start = arguments->stem.empty() ? "" : ", stem " + arguments->stem.string();
      fmt::print(stderr, "wrote {} ({}, seed {}{})\n", arguments->out.string(), arguments->size,
                 arguments->seed, start);
      document["checkpoint"] = arguments->out.string();
    }
    if (!arguments->asset.empty()) {
      animal::write_synthetic_asset(arguments->asset);
      fmt::print(stderr, "wrote {}\n", arguments->asset.string());
      document["smal_asset"] = arguments->asset.string();
    }
    if (!arguments->priors.empty()) {
      animal::write_synthetic_priors(arguments->priors);
      fmt::print(stderr, "wrote {}\n", arguments->priors.string());
      document["priors"] = arguments->priors.string();
    }
    if (arguments->json) fmt::print("{}\n", document.dump());
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
