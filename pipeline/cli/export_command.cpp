#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/cli/python_program.h"
#include "pipeline/dataset/export_list.h"
#include "pipeline/exports/export_dataset.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  std::filesystem::path dataset;
  std::string format;
  std::string python = "python3";
  exports::ExportOptions options;
  bool json = false;
};

void print_summary(const exports::ExportSummary& summary, const std::filesystem::path& out) {
  for (const std::string& name : summary.without_licence) {
    fmt::print(
        stderr,
        "note: {} states no licence, so its pictures were left out and its numbers refer to the source's "
        "own pictures; --pictures-anyway exports them\n",
        name);
  }
  fmt::print(stderr, "{} samples and {} pictures in {}{}\n", summary.samples, summary.pictures, out.string(),
             summary.was_complete ? " (was complete)" : "");
  for (const std::string& file : summary.files) fmt::print(stderr, "  {}\n", (out / file).string());
}

int export_here(const Arguments& arguments) {
  const exports::ExportSummary summary = exports::export_dataset(arguments.dataset, arguments.options);
  print_summary(summary, arguments.options.out);
  if (arguments.json) {
    const nlohmann::ordered_json document = {{"out", arguments.options.out.string()},
                                             {"samples", summary.samples},
                                             {"pictures", summary.pictures},
                                             {"without_licence", summary.without_licence},
                                             {"files", summary.files},
                                             {"was_complete", summary.was_complete}};
    fmt::print("{}\n", document.dump());
  }
  return 0;
}

// Runs the export in Python: pyarrow writes Parquet files, because Debian 12 has no Arrow for C++.
int export_in_python(const Arguments& arguments) {
  const PythonCheck check = check_python(arguments.python, "quadruped3d.export.parquet");
  if (!check.has_module) {
    throw run::ConfigError(fmt::format(
        "export --format {} needs the Python package quadruped3d with pyarrow, and {} cannot import it ({}). "
        "Install it in the repository with\n  {} -m pip install './python[export]'\nor name another "
        "interpreter "
        "with --python",
        arguments.format, arguments.python, check.message, arguments.python));
  }
  dataset::list_export(dataset::PublishedDataset(arguments.dataset), arguments.format,
                       arguments.options.pictures_anyway, arguments.options.out);
  std::vector<std::string> words{arguments.format, arguments.dataset.string(), "--out",
                                 arguments.options.out.string()};
  if (arguments.options.pictures_anyway) words.emplace_back("--pictures-anyway");
  if (arguments.options.quiet) words.emplace_back("--quiet");
  if (arguments.json) words.emplace_back("--json");
  return become_python(arguments.python, "quadruped3d.export", words);
}

}  // namespace

Command add_export(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = declare(app, "export");
  command->add_option("dataset", arguments->dataset, "a dataset's folder, or an output folder")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("-f,--format", arguments->format, "prima, coco, parquet or hf")
      ->required()
      ->check(CLI::IsMember({"prima", "coco", "parquet", "hf"}));
  out_option(*command, arguments->options.out, "folder for the export; empty, or that of the same export")
      ->required();
  command->add_flag("--pictures-anyway", arguments->options.pictures_anyway,
                    "export also the pictures of datasets whose licence is not stated");
  command
      ->add_option("--python", arguments->python,
                   "Python interpreter with the package quadruped3d, for parquet and hf")
      ->capture_default_str();
  threads_option(*command, arguments->options.threads,
                 "number of threads that make pictures (0 = all cores)");
  json_flag(*command, arguments->json);
  quiet_flag(*command, arguments->options.quiet);
  command->footer(
      "Formats:\n"
      "  prima    JSON, pictures and masks as the training of PRIMA and AniMer reads them\n"
      "  coco     COCO keypoints with pictures, for annotation tools; `corrections` takes changes back\n"
      "  parquet  labels alone, one row a sample\n"
      "  hf       Parquet files with pictures and a README card, for Hugging Face\n"
      "Examples:\n"
      "  quadruped3d export out --format prima --out exports/prima\n"
      "  quadruped3d export out --format hf --out exports/hf\n"
      "An export that was stopped goes on where it ended when the same command is run again. docs/export.md\n"
      "describes every file.");
  return [arguments] {
    if (arguments->format == "parquet" || arguments->format == "hf") return export_in_python(*arguments);
    arguments->options.format = arguments->format == "prima" ? exports::Format::prima : exports::Format::coco;
    return export_here(*arguments);
  };
}

}  // namespace q3d::pipeline::cli
