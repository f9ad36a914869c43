#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/curation/curate_run.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  ConfigArguments config;
  std::filesystem::path out;
  bool json = false;
};

std::int64_t count_of(const std::map<std::string, std::int64_t>& counts, const std::string& name) {
  const auto found = counts.find(name);
  return found == counts.end() ? 0 : found->second;
}

void print_species(const curation::CurationSummary& summary) {
  fmt::print(stderr, "\n  {:<24}", "chosen of available");
  for (const auto& [split, verdicts] : summary.verdicts) fmt::print(stderr, "{:>18}", split);
  fmt::print(stderr, "\n");
  for (const auto& [species, available] : summary.available) {
    fmt::print(stderr, "  {:<24}", species);
    const auto chosen = summary.chosen.find(species);
    for (const auto& [split, verdicts] : summary.verdicts) {
      const std::int64_t taken = chosen == summary.chosen.end() ? 0 : count_of(chosen->second, split);
      fmt::print(stderr, "{:>18}", fmt::format("{} of {}", taken, count_of(available, split)));
    }
    fmt::print(stderr, "\n");
  }
}

void print_summary(const curation::CurationSummary& summary) {
  for (const std::string& note : summary.notes) fmt::print(stderr, "note: {}\n", note);
  print_species(summary);
  for (const auto& [split, verdicts] : summary.verdicts) {
    fmt::print(stderr, "\n  {}\n", split);
    for (const auto& [verdict, count] : verdicts) fmt::print(stderr, "    {:<22} {}\n", verdict, count);
  }
  fmt::print(stderr, "\n  list of all pictures: {}\n", summary.list.string());
  fmt::print(stderr,
             "Name this list as \"curation\" of the dataset in a build's config (docs/datasets.md).\n");
}

}  // namespace

Command add_curate(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "curate");
  config_option(*command, arguments->config,
                "JSON file with the rule; keys of a later file replace those of an earlier one")
      ->required();
  out_option(*command, arguments->out, "folder for the list")->required();
  json_flag(*command, arguments->json);
  command->footer(
      "Examples:\n"
      "  quadruped3d curate --config configs/quadruped2d.json --out out/curation\n"
      "Then name the list in the config of a build:\n"
      "  \"datasets\": [ { \"name\": \"superanimal\", ...,\n"
      "                  \"curation\": \"out/curation/quadruped2d.csv\" } ]\n"
      "The command reads no pictures. The same files, rule and seed give the same list. NAME.json beside\n"
      "the list holds the rule, the digests of the files that were read, and all counts.");
  return [arguments] {
    const curation::CurationSummary summary = curation::run_curate(
        curation::load_curation_config(arguments->config.files, arguments->config.settings()),
        arguments->out);
    print_summary(summary);
    if (arguments->json) {
      const nlohmann::ordered_json document = {{"list", summary.list.string()},
                                               {"verdicts", summary.verdicts},
                                               {"chosen", summary.chosen},
                                               {"available", summary.available},
                                               {"species_not_listed", summary.species_not_listed},
                                               {"notes", summary.notes}};
      fmt::print("{}\n", document.dump());
    }
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
