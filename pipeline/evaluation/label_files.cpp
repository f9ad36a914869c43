#include "pipeline/evaluation/label_files.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <stdexcept>

#include "manifests/atomic_file.h"
#include "manifests/verdict.h"
#include "pipeline/evaluation/csv.h"

namespace q3d::pipeline::evaluation {
namespace {

namespace fs = std::filesystem;
using manifests::Verdict;
using nlohmann::json;

std::vector<StoredLabel> read_candidates(const std::vector<CsvRow>& rows) {
  if (rows.empty()) throw std::invalid_argument("the file is empty");
  const std::size_t id = column_of(rows[0], "id");
  const std::size_t verdict = column_of(rows[0], "verdict");
  std::vector<StoredLabel> labels;
  for (std::size_t r = 1; r < rows.size(); ++r) {
    StoredLabel& label = labels.emplace_back();
    label.id = rows[r][id];
    const Verdict judged = manifests::verdict_from_string(rows[r][verdict]);
    label.kept = judged == Verdict::retained || judged == Verdict::refined;
    for (const MetricInfo& info : kMetrics) {
      label.values[index_of(info.metric)] =
          number_of(rows[r][column_of(rows[0], fmt::format("label_{}", info.key))]);
    }
  }
  return labels;
}

void read_description(const fs::path& file, StoredLabels& labels) {
  const json document = json::parse(manifests::read_file(file));
  if (document.at("format") != "quadruped3d-label-evaluation" || document.at("schema") != 1) {
    throw std::runtime_error(fmt::format(
        "got format {} schema {}, expected \"quadruped3d-label-evaluation\" schema 1; run `evaluate-labels` "
        "again",
        document.at("format").dump(), document.at("schema").dump()));
  }
  labels.dataset = document.at("dataset").get<std::string>();
  labels.content_id = document.at("content_id").get<std::string>();
  labels.truth_sha256 = document.at("truth_sha256").get<std::vector<std::string>>();
}

}  // namespace

StoredLabels read_label_evaluation(const fs::path& folder) {
  StoredLabels labels;
  labels.folder = folder.string();
  fs::path reading = folder / "labels.json";
  try {
    read_description(reading, labels);
    reading = folder / "labels.csv";
    labels.candidates = read_candidates(parse_csv(manifests::read_file(reading)));
    return labels;
  } catch (const std::exception& error) {
    const std::string what = error.what();
    const bool is_named = what.find(reading.string()) != std::string::npos;
    throw std::runtime_error(is_named ? what : fmt::format("{}: {}", reading.string(), what));
  }
}

}  // namespace q3d::pipeline::evaluation
