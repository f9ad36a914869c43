#include "pipeline/cli/options.h"

#include <nlohmann/json.hpp>

#include <cstdlib>

#include "manifests/durability.h"

namespace q3d::pipeline::cli {

std::vector<std::string> ConfigArguments::settings() const {
  std::vector<std::string> all = set;
  if (!device.empty()) all.push_back("network.device=" + nlohmann::json(device).dump());
  return all;
}

std::vector<std::string> ConfigArguments::words() const {
  std::vector<std::string> all;
  for (const std::filesystem::path& file : files) all.insert(all.end(), {"--config", file.string()});
  for (const std::string& setting : set) all.insert(all.end(), {"--set", setting});
  if (!device.empty()) all.insert(all.end(), {"--device", device});
  return all;
}

CLI::Option* config_option(CLI::App& command, ConfigArguments& config, const std::string& text) {
  command
      .add_option("--set", config.set,
                  "set one key of the config, such as --set tta.learning_rate=2e-6 or --set "
                  "datasets.walk.species=goat; may be given several times (docs/config.md)")
      ->type_name("KEY=VALUE")
      ->type_size(1)
      ->allow_extra_args(false);
  return command.add_option("-c,--config", config.files, text)->check(CLI::ExistingFile);
}

CLI::Option* device_option(CLI::App& command, ConfigArguments& config) {
  return command
      .add_option("--device", config.device,
                  "where the network runs, instead of the config's network.device: auto, cpu, cuda "
                  "or cuda:1; several GPUs, such as cuda:0,cuda:1, where --ranks is an option too")
      ->type_name("DEVICE");
}

CLI::Option* out_option(CLI::App& command, std::filesystem::path& out, const std::string& text) {
  const auto without = [](bool manifests::Durability::*part) {
    return [part] {
      manifests::Durability wanted = manifests::durability();
      wanted.*part = false;
      manifests::set_durability(wanted);
    };
  };
  command.add_flag_callback(
      "--no-sync", without(&manifests::Durability::syncs),
      "do not wait until files have reached the disk, for file systems that cannot sync");
  command.add_flag_callback("--no-lock", without(&manifests::Durability::locks),
                            "do not lock the output folder, for file systems that have no locks");
  return command.add_option("-o,--out", out, text)->type_name("FOLDER");
}

CLI::Option* out_file_option(CLI::App& command, std::filesystem::path& out, const std::string& text) {
  return out_option(command, out, text)->type_name("FILE");
}

CLI::Option* threads_option(CLI::App& command, int& threads, const std::string& text) {
  return command.add_option("-t,--threads", threads, text)->check(CLI::NonNegativeNumber);
}

CLI::Option* ranks_option(CLI::App& command) {
  const auto require_launcher = [](int ranks) {
    if (ranks == 1 || std::getenv("WORLD_SIZE") != nullptr) return;
    throw CLI::ValidationError("--ranks", "only the program quadruped3d starts ranks");
  };
  return command
      .add_option_function<int>(
          "--ranks", require_launcher,
          "number of processes on this machine that share the work, each with a GPU or cores of its own "
          "(docs/scale.md)")
      ->type_name("N")
      ->check(CLI::Range(1, kMostRanks));
}

CLI::Option* json_flag(CLI::App& command, bool& json, const std::string& text) {
  return command.add_flag("--json", json, text);
}

CLI::Option* above_ceiling_flag(CLI::App& command, bool& above_ceiling) {
  return command.add_flag("--above-ceiling", above_ceiling,
                          "go on with a tau_high above filter.tau_ceiling; a warning stays");
}

CLI::Option* quiet_flag(CLI::App& command, bool& quiet) {
  return command.add_flag("-q,--quiet", quiet, "do not show progress");
}

void comparison_options(CLI::App& command, filters::BootstrapOptions& bootstrap, std::filesystem::path& out,
                        bool& json) {
  command.add_option("--resamples", bootstrap.resamples, "number of resamples of the bootstrap")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  command.add_option("--seed", bootstrap.seed, "seed of the bootstrap")->capture_default_str();
  out_file_option(command, out, "write the comparison to this file as JSON");
  json_flag(command, json, "print the comparison as JSON to stdout");
}

}  // namespace q3d::pipeline::cli
