#include "pipeline/evaluation/evaluation_files.h"

#include <fmt/format.h>

#include <stdexcept>

#include "manifests/atomic_file.h"
#include "pipeline/evaluation/csv.h"
#include "pipeline/evaluation/report.h"

namespace q3d::pipeline::evaluation {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

void read_samples(const std::vector<CsvRow>& rows, StoredEvaluation& evaluation) {
  if (rows.empty()) throw std::invalid_argument("the file is empty");
  const CsvRow& header = rows.front();
  const std::size_t dataset = column_of(header, "dataset"), id = column_of(header, "id"),
                    left_out = column_of(header, "left_out"), setting = column_of(header, "setting"),
                    normaliser = column_of(header, "normaliser");
  std::array<std::size_t, kMetricCount> metrics{};
  for (const MetricInfo& info : kMetrics) metrics[index_of(info.metric)] = column_of(header, info.key);
  for (std::size_t r = 1; r < rows.size(); ++r) {
    const CsvRow& row = rows[r];
    if (!row[left_out].empty()) continue;
    const auto known = evaluation.datasets.find(row[dataset]);
    if (known == evaluation.datasets.end()) {
      throw std::invalid_argument("the dataset " + row[dataset] + " is not in evaluation.json");
    }
    StoredSample sample{row[id], row[normaliser], {}};
    for (std::size_t m = 0; m < kMetricCount; ++m) sample.values[m] = number_of(row[metrics[m]]);
    known->second.settings[row[setting]].push_back(std::move(sample));
  }
}

StoredEvaluation read_description(const fs::path& file) {
  const json document = json::parse(manifests::read_file(file));
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
    read_samples(parse_csv(manifests::read_file(samples)), evaluation);
    return evaluation;
  } catch (const std::exception& error) {
    const std::string what = error.what();
    const bool is_named = what.find(reading.string()) != std::string::npos;
    throw std::runtime_error(is_named ? what : fmt::format("{}: {}", reading.string(), what));
  }
}

}  // namespace q3d::pipeline::evaluation
