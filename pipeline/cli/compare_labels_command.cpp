#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <stdexcept>

#include "manifests/atomic_file.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/evaluation/compare_labels.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  std::vector<std::filesystem::path> before;
  std::vector<std::filesystem::path> after;
  filters::BootstrapOptions bootstrap;
  std::filesystem::path out;
  bool json = false;
};

std::vector<evaluation::StoredLabels> read_all(const std::vector<std::filesystem::path>& folders) {
  std::vector<evaluation::StoredLabels> labels;
  for (const auto& folder : folders) labels.push_back(evaluation::read_label_evaluation(folder));
  return labels;
}

int run(const Arguments& arguments) {
  const auto before = read_all(arguments.before);
  const auto after = read_all(arguments.after);
  evaluation::LabelComparison comparison;
  try {
    comparison = evaluation::compare_labels(before, after, arguments.bootstrap);
  } catch (const std::invalid_argument& error) {
    throw run::ConfigError(std::string("compare-labels: ") + error.what());
  }
  const nlohmann::ordered_json document = evaluation::to_json(comparison, before, after);
  if (!arguments.out.empty()) manifests::write_file_atomically(arguments.out, document.dump(2) + "\n");
  std::FILE* const people = arguments.json ? stderr : stdout;
  fmt::print(people, "{}", evaluation::summary_text(comparison));
  fmt::print(people,
             "PA in mm. {} bootstrap resamples over pictures{}; better and worse mean that the interval "
             "excludes 0\n",
             arguments.bootstrap.resamples,
             comparison.pairs.size() > 1 ? fmt::format(" and {} pairs", comparison.pairs.size()) : "");
  if (!arguments.out.empty()) fmt::print(people, "wrote {}\n", arguments.out.string());
  if (arguments.json) fmt::print("{}\n", document.dump());
  return 0;
}

}  // namespace

Command add_compare_labels(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "compare-labels");
  command->add_option("--before", arguments->before, "folders that `evaluate-labels --report` wrote")
      ->required()
      ->check(CLI::ExistingDirectory);
  command
      ->add_option("--after", arguments->after,
                   "the same number of folders, of builds over the same pools, in the same order")
      ->required()
      ->check(CLI::ExistingDirectory);
  comparison_options(*command, arguments->bootstrap, arguments->out, arguments->json);
  command->footer(
      "Examples:\n"
      "  quadruped3d compare-labels --before out/paper_labels --after out/strict_labels\n"
      "  quadruped3d compare-labels --before p1 p2 p3 --after s1 s2 s3 --out comparison.json\n"
      "The larger set of labels is cut to the size of the smaller one; labels with the largest L_proj go\n"
      "first. The second example compares three pairs of builds. docs/evaluation.md shows the whole way\n"
      "from two builds to this command.");
  return [arguments] { return run(*arguments); };
}

}  // namespace q3d::pipeline::cli
