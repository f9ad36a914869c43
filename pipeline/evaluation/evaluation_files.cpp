#include "pipeline/evaluation/evaluation_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <stdexcept>

#include "manifests/atomic_file.h"
#include "pipeline/evaluation/csv.h"
#include "pipeline/evaluation/report.h"

namespace q3d::pipeline::evaluation {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::optional<double> parse_number(const std::string& text) {
  if (text.empty()) return std::nullopt;
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) {
    throw std::invalid_argument("got \"" + text + "\", expected a number or nothing");
  }
  return value;
}

// Columns by name, so that a later version may add some.
class Columns {
 public:
  explicit Columns(const CsvRow& header) : header_(header) {}
  std::size_t operator[](const std::string& name) const {
    const auto found = std::find(header_.begin(), header_.end(), name);
    if (found == header_.end()) throw std::invalid_argument("the column \"" + name + "\" is missing");
    return static_cast<std::size_t>(found - header_.begin());
  }

 private:
  const CsvRow& header_;
};

void read_samples(const std::vector<CsvRow>& rows, StoredEvaluation& evaluation) {
  if (rows.empty()) throw std::invalid_argument("the file is empty");
  const Columns columns(rows.front());
  const std::size_t dataset = columns["dataset"], id = columns["id"], left_out = columns["left_out"],
                    setting = columns["setting"], normaliser = columns["normaliser"];
  std::array<std::size_t, kMetricCount> metrics{};
  for (const MetricInfo& info : kMetrics) metrics[index_of(info.metric)] = columns[info.key];
  for (std::size_t r = 1; r < rows.size(); ++r) {
    const CsvRow& row = rows[r];
    if (!row[left_out].empty()) continue;
    const auto known = evaluation.datasets.find(row[dataset]);
    if (known == evaluation.datasets.end()) {
      throw std::invalid_argument("the dataset " + row[dataset] + " is not in evaluation.json");
    }
    StoredSample sample{row[id], row[normaliser], {}};
    for (std::size_t m = 0; m < kMetricCount; ++m) sample.values[m] = parse_number(row[metrics[m]]);
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
