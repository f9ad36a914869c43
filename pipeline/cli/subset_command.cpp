#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/derived/operations.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  std::filesystem::path dataset;
  std::string where;
  std::filesystem::path out;
  std::string name;
  std::string version = "1.0.0";
  bool json = false;
};

}  // namespace

Command add_subset(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "subset");
  command->add_option("dataset", arguments->dataset, "a dataset's folder, or an output folder")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("--where", arguments->where, "condition on a candidate; see below")->required();
  out_option(*command, arguments->out, "folder for the new version")->required();
  command->add_option("--name", arguments->name, "name of the new dataset; without it, the name stays");
  command->add_option("--dataset-version", arguments->version, "semantic version of the new dataset")
      ->capture_default_str();
  json_flag(*command, arguments->json);
  command->footer(
      "Examples:\n"
      "  quadruped3d subset out --where 'species = lion and trust > 0.8' --out out --name lions\n"
      "  quadruped3d subset out --where 'not (family = none or species = \"red fox\")' --out out\n"
      "A condition compares fields (species, family, dataset, split, source, id, verdict, reason, "
      "label_kind,\n"
      "initial_error, final_error, gain, iterations, best_iteration, trust, trust_*) by =, !=, <, <=, > and "
      ">=,\n"
      "joined by and, or, not and parentheses. Candidates that do not fulfil it are no part of the new "
      "version.\n"
      "Shards that stay whole are linked; docs/versions.md says more.");
  return [arguments] {
    const derived::DerivedVersion version = derived::subset(
        arguments->dataset, arguments->where, arguments->out, arguments->name, arguments->version);
    fmt::print(stderr, "{}: {} candidates, {} kept; {} shards linked, {} written{}\n",
               version.folder.string(), version.counts.candidates,
               version.counts.retained + version.counts.refined, version.shards_linked,
               version.shards_written, version.was_up_to_date ? " (was up to date)" : "");
    fmt::print(stderr, "next: quadruped3d verify {}\n", version.folder.string());
    if (arguments->json) {
      const nlohmann::ordered_json document = {{"dataset", version.folder.string()},
                                               {"candidates", version.counts.candidates},
                                               {"shards_linked", version.shards_linked},
                                               {"shards_written", version.shards_written},
                                               {"was_up_to_date", version.was_up_to_date}};
      fmt::print("{}\n", document.dump());
    }
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
