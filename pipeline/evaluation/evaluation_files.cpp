#include "pipeline/evaluation/evaluation_files.h"

#include <fmt/format.h>

#include <stdexcept>

#include "manifests/atomic_file.h"
#include "manifests/csv.h"
#include "manifests/json_parse.h"
#include "pipeline/evaluation/report.h"

namespace q3d::pipeline::evaluation {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

void read_samples(manifests::CsvTableReader rows, StoredEvaluation& evaluation) {
  const std::size_t dataset = rows.column("dataset"), id = rows.column("id"),
                    left_out = rows.column("left_out"), setting = rows.column("setting"),
                    normaliser = rows.column("normaliser");
  std::array<std::size_t, kMetricCount> metrics{};
  for (const MetricInfo& info : kMetrics) metrics[index_of(info.metric)] = rows.column(info.key);
  while (rows.next()) {
    if (!rows.cell(left_out).empty()) continue;
    const auto known = evaluation.datasets.find(rows.cell(dataset));
    if (known == evaluation.datasets.end()) {
      rows.fail("the dataset " + rows.cell(dataset), "one of those in evaluation.json");
    }
    StoredSample sample{rows.cell(id), rows.cell(normaliser), {}};
    for (std::size_t m = 0; m < kMetricCount; ++m) sample.values[m] = rows.number(metrics[m]);
    known->second.settings[rows.cell(setting)].push_back(std::move(sample));
  }
}

StoredEvaluation read_description(const fs::path& file) {
  const json document = manifests::parse_json<json>(manifests::read_file(file));
  if (document.at("format") != kEvaluationFormat || document.at("schema") != kEvaluationSchema) {
    throw std::runtime_error(fmt::format(
        "got format {} schema {}, expected \"{}\" schema {}; evaluate the network again",
        document.at("format").dump(), document.at("schema").dump(), kEvaluationFormat, kEvaluationSchema));
  }
  StoredEvaluation evaluation;
  evaluation.checkpoint = document.at("checkpoint").at("file").get<std::string>();
  evaluation.checkpoint_sha256 = document.at("checkpoint").at("sha256").get<std::string>();
  for (const json& setting : document.at("settings")) {
    evaluation.setting_names.push_back(setting.at("name").get<std::string>());
  }
  for (const json& dataset : document.at("datasets")) {
    const auto name = dataset.at("dataset").get<std::string>();
    StoredDataset& stored = evaluation.datasets[name];
    stored.annotations_sha256 = dataset.at("annotations_sha256").get<std::string>();
    if (!dataset.at("truth_sha256").is_null()) {
      stored.truth_sha256 = dataset.at("truth_sha256").get<std::string>();
    }
    evaluation.dataset_names.push_back(name);
  }
  return evaluation;
}

}  // namespace

StoredEvaluation read_evaluation(const fs::path& path) {
  const fs::path folder = fs::is_directory(path) ? path : path.parent_path();
  const fs::path description = folder / "evaluation.json";
  const fs::path samples = folder / "samples.csv";
  fs::path reading = description;
  try {
    StoredEvaluation evaluation = read_description(description);
    evaluation.folder = folder.string();
    reading = samples;
    const std::string text = manifests::read_file(samples);
    read_samples({text, samples.string()}, evaluation);
    return evaluation;
  } catch (const std::exception& error) {
    const std::string what = error.what();
    const bool is_named = what.find(reading.string()) != std::string::npos;
    throw std::runtime_error(is_named ? what : fmt::format("{}: {}", reading.string(), what));
  }
}

}  // namespace q3d::pipeline::evaluation
