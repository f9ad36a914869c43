#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/derived/operations.h"

namespace q3d::pipeline::cli {
namespace {

constexpr std::size_t kShownIds = 10;

struct Arguments {
  std::vector<std::filesystem::path> versions;
  std::filesystem::path out;
  std::string name;
  std::string version = "1.0.0";
  bool json = false;
};

void print_summary(const derived::MergeSummary& summary) {
  const derived::DerivedVersion& version = summary.version;
  for (std::size_t i = 0; i < std::min(kShownIds, summary.repeated_ids.size()); ++i) {
    fmt::print(stderr, "duplicate: {} is in an earlier version too, whose label is kept\n",
               summary.repeated_ids[i]);
  }
  if (summary.repeated_ids.size() > kShownIds) {
    fmt::print(stderr, "  and {} more\n", summary.repeated_ids.size() - kShownIds);
  }
  if (summary.same_pictures > 0) {
    fmt::print(
        stderr,
        "note: {} candidates have a picture that an earlier version has under another id; they are kept\n",
        summary.same_pictures);
  }
  fmt::print(stderr, "{}: {} candidates, {} kept; {} shards linked, {} written{}\n", version.folder.string(),
             version.counts.candidates, version.counts.retained + version.counts.refined,
             version.shards_linked, version.shards_written,
             version.was_up_to_date ? " (was up to date)" : "");
  fmt::print(stderr, "next: quadruped3d verify {}\n", version.folder.string());
}

}  // namespace

Command add_merge(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "merge");
  command->add_option("versions", arguments->versions, "the datasets' folders, or output folders")
      ->required()
      ->expected(2, -1)
      ->check(CLI::ExistingDirectory);
  out_option(*command, arguments->out, "folder for the new version")->required();
  command->add_option("--name", arguments->name,
                      "name of the new dataset; without it, the names joined by +");
  command->add_option("--dataset-version", arguments->version, "semantic version of the new dataset")
      ->capture_default_str();
  json_flag(*command, arguments->json);
  command->footer(
      "Example:\n"
      "  quadruped3d merge out/dogs-0123456789ab out/cats-ba9876543210 --out out --name pets\n"
      "Of candidates with one id, the first version's is taken, and the others are told. The new "
      "dataset.json\n"
      "holds the provenance of all versions. docs/versions.md says more.");
  return [arguments] {
    const derived::MergeSummary summary =
        derived::merge(arguments->versions, arguments->out, arguments->name, arguments->version);
    print_summary(summary);
    if (arguments->json) {
      const nlohmann::ordered_json document = {{"dataset", summary.version.folder.string()},
                                               {"candidates", summary.version.counts.candidates},
                                               {"repeated_ids", summary.repeated_ids},
                                               {"same_pictures", summary.same_pictures},
                                               {"shards_linked", summary.version.shards_linked},
                                               {"shards_written", summary.version.shards_written},
                                               {"was_up_to_date", summary.version.was_up_to_date}};
      fmt::print("{}\n", document.dump());
    }
    return 0;
  };
}

}  // namespace q3d::pipeline::cli
