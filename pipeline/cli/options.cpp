#include "pipeline/cli/options.h"

namespace q3d::pipeline::cli {

CLI::Option* config_option(CLI::App& command, std::vector<std::filesystem::path>& configs,
                           const std::string& text) {
  return command.add_option("-c,--config", configs, text)->check(CLI::ExistingFile);
}

CLI::Option* out_option(CLI::App& command, std::filesystem::path& out, const std::string& text) {
  return command.add_option("-o,--out", out, text);
}

CLI::Option* threads_option(CLI::App& command, int& threads, const std::string& text) {
  return command.add_option("-t,--threads", threads, text)->check(CLI::NonNegativeNumber);
}

CLI::Option* json_flag(CLI::App& command, bool& json, const std::string& text) {
  return command.add_flag("--json", json, text);
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
  out_option(command, out, "write the comparison to this file as JSON");
  json_flag(command, json, "print the comparison as JSON to stdout");
}

}  // namespace q3d::pipeline::cli
