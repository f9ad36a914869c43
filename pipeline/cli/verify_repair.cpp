#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <optional>

#include "pipeline/build/repair.h"
#include "pipeline/cli/verify_command.h"
#include "pipeline/run/printable.h"
#include "pipeline/run/words.h"

namespace q3d::pipeline::cli {
namespace {

nlohmann::ordered_json strings(const std::vector<std::filesystem::path>& paths) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const std::filesystem::path& path : paths) list.push_back(path.string());
  return list;
}

void tell(const build::RepairSummary& summary, bool has_config) {
  for (const std::string& problem : summary.problems)
    fmt::print(stderr, "problem: {}\n", run::printable_line(problem));
  for (const auto& file : summary.quarantined) fmt::print(stderr, "moved to {}\n", file.string());
  for (const auto& file : summary.copied) fmt::print(stderr, "mended from a copy: {}\n", file.string());
  if (summary.was_built) fmt::print(stderr, "made the rest again from the sources and the stages\n");
  for (const std::string& problem : summary.unrepaired)
    fmt::print(stderr, "not repaired: {}\n", run::printable_line(problem));
  if (!summary.unrepaired.empty() && !has_config) {
    fmt::print(stderr, "give the --config files of the build to make what has no copy again\n");
  }
  const auto left = static_cast<std::int64_t>(summary.unrepaired.size());
  fmt::print(stderr, "{}: {}\n", summary.folder.string(),
             left > 0                   ? run::counted(left, "problem") + " left"
             : summary.problems.empty() ? "sound, nothing to repair"
                                        : "repaired");
}

int repair(const RepairArguments& arguments) {
  std::optional<config::BuildConfig> config;
  if (!arguments.config.files.empty()) {
    config = config::load_build_config(arguments.config.files, arguments.config.settings());
  }
  const build::RepairSummary summary = build::repair(arguments.dataset, config, arguments.run);
  tell(summary, config.has_value());
  if (arguments.json) {
    const nlohmann::ordered_json document = {
        {"dataset", summary.folder.string()}, {"sound", summary.unrepaired.empty()},
        {"problems", summary.problems},       {"quarantined", strings(summary.quarantined)},
        {"copied", strings(summary.copied)},  {"was_built", summary.was_built},
        {"unrepaired", summary.unrepaired}};
    fmt::print("{}\n", document.dump());
  }
  return summary.unrepaired.empty() ? 0 : 1;
}

}  // namespace

Command add_verify_with_repair(CLI::App& app) {
  return add_verify_with(app, repair);
}

}  // namespace q3d::pipeline::cli
