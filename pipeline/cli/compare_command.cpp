#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <stdexcept>

#include "manifests/atomic_file.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/evaluation/compare.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  std::vector<std::filesystem::path> before;
  std::vector<std::filesystem::path> after;
  evaluation::CompareOptions options;
  std::filesystem::path out;
  bool json = false;
};

std::vector<evaluation::StoredEvaluation> read_all(const std::vector<std::filesystem::path>& paths) {
  std::vector<evaluation::StoredEvaluation> evaluations;
  for (const auto& path : paths) evaluations.push_back(evaluation::read_evaluation(path));
  return evaluations;
}

int run(const Arguments& arguments) {
  const auto before = read_all(arguments.before);
  const auto after = read_all(arguments.after);
  evaluation::Comparison comparison;
  try {
    comparison = evaluation::compare(before, after, arguments.options);
  } catch (const std::invalid_argument& error) {
    throw run::ConfigError(std::string("compare: ") + error.what());
  }
  const nlohmann::ordered_json document = evaluation::to_json(comparison, before, after);
  if (!arguments.out.empty()) manifests::write_file_atomically(arguments.out, document.dump(2) + "\n");
  std::FILE* const people = arguments.json ? stderr : stdout;
  fmt::print(people, "{}", evaluation::summary_text(comparison));
  fmt::print(people,
             "{} bootstrap resamples over pictures{}; better and worse mean that the interval excludes 0\n",
             arguments.options.bootstrap.resamples,
             comparison.pairs > 1 ? fmt::format(" and {} pairs of runs", comparison.pairs) : "");
  if (!arguments.out.empty()) fmt::print(people, "wrote {}\n", arguments.out.string());
  if (arguments.json) fmt::print("{}\n", document.dump());
  return 0;
}

}  // namespace

Command add_compare(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  evaluation::CompareOptions& options = arguments->options;
  CLI::App* command = declare(app, "compare");
  command->add_option("--before", arguments->before, "folders that `evaluate` wrote, one for each seed")
      ->required()
      ->check(CLI::ExistingPath);
  command->add_option("--after", arguments->after, "the same number of folders, in the same order")
      ->required()
      ->check(CLI::ExistingPath);
  command->add_option("--before-setting", options.before_setting,
                      "setting to compare, such as \"prediction\"; needs --after-setting");
  command->add_option("--after-setting", options.after_setting,
                      "setting to compare it with, such as \"TTA 30\"");
  comparison_options(*command, options.bootstrap, arguments->out, arguments->json);
  command->footer(
      "Examples:\n"
      "  quadruped3d compare --before out/stage1/evaluation --after out/stage3/evaluation\n"
      "  quadruped3d compare --before s1_a s1_b s1_c --after s3_a s3_b s3_c --out comparison.json\n"
      "  quadruped3d compare --before eval --after eval --before-setting prediction \\\n"
      "      --after-setting 'TTA 30'\n"
      "Samples are paired by id. A paired bootstrap gives the 95 % interval of the mean difference. The\n"
      "second example compares three seeds, the third two settings of one evaluation.");
  return [arguments] { return run(*arguments); };
}

}  // namespace q3d::pipeline::cli
