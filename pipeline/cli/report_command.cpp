#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options.h"
#include "pipeline/network/torch_bodies.h"
#include "pipeline/report/report_run.h"

namespace q3d::pipeline::cli {
namespace {

struct Arguments {
  report::ReportOptions options;
  ConfigArguments config;
  bool json = false;
};

int run(const Arguments& arguments) {
  report::ReportOptions options = arguments.options;
  if (!arguments.config.files.empty()) {
    options.config = config::load_build_config(arguments.config.files, arguments.config.settings());
  }
  const report::ReportSummary summary = report::write_report(options, network::load_body_meshes);
  fmt::print(stderr, "{}: {}\nopen it in a browser; it needs no network\n",
             summary.was_up_to_date ? "the report was up to date" : "wrote the report",
             summary.page.string());
  if (arguments.json) {
    fmt::print("{}\n", nlohmann::ordered_json({{"page", summary.page.string()},
                                               {"statistics", summary.statistics.string()},
                                               {"up_to_date", summary.was_up_to_date}})
                           .dump());
  }
  return 0;
}

}  // namespace

Command add_report(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  report::ReportOptions& options = arguments->options;
  CLI::App* command = declare(app, "report");
  command->add_option("dataset", options.dataset, "a dataset's folder, or an output folder of `build`")
      ->required()
      ->check(CLI::ExistingPath);
  out_option(*command, options.folder, "folder for the files (default: OUT/report/<version>)");
  command->add_option("--gallery", options.gallery_size, "pictures in each gallery; 0 leaves them out")
      ->capture_default_str()
      ->check(CLI::Range(0, 100));
  config_option(*command, arguments->config,
                "the build's config, if pictures or the body model are not found without it");
  command->add_option("--body", options.body, "body model (default: the one that the dataset was made with)")
      ->check(CLI::ExistingFile);
  json_flag(*command, arguments->json, "print the files' paths as JSON");
  command->footer(
      "Examples:\n"
      "  quadruped3d report out\n"
      "  quadruped3d report out/latest --out pages --gallery 12\n"
      "It writes report.html, one file that opens without a network, and statistics.json with all numbers "
      "of\n"
      "it. docs/report.md explains how to read each part. A report that is there already is made again only\n"
      "if the dataset has changed.");
  return [arguments] { return run(*arguments); };
}

}  // namespace q3d::pipeline::cli
