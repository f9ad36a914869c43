#include "pipeline/evaluation/label_files.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <stdexcept>

#include "manifests/atomic_file.h"
#include "manifests/csv.h"
#include "manifests/enumerators.h"
#include "manifests/json_parse.h"

namespace q3d::pipeline::evaluation {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::vector<StoredLabel> read_candidates(manifests::CsvTableReader rows) {
  const std::size_t id = rows.column("id");
  const std::size_t verdict = rows.column("verdict");
  std::array<std::size_t, kMetricCount> metrics{};
  for (const MetricInfo& info : kMetrics) {
    metrics[index_of(info.metric)] = rows.column(fmt::format("label_{}", info.key));
  }
  std::vector<StoredLabel> labels;
  while (rows.next()) {
    StoredLabel& label = labels.emplace_back();
    label.id = rows.cell(id);
    label.kept = manifests::is_kept(manifests::verdict_from_string(rows.cell(verdict)));
    for (std::size_t m = 0; m < kMetricCount; ++m) label.values[m] = rows.number(metrics[m]);
  }
  return labels;
}

void read_description(const fs::path& file, StoredLabels& labels) {
  const json document = manifests::parse_json<json>(manifests::read_file(file));
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
    const std::string text = manifests::read_file(reading);
    labels.candidates = read_candidates({text, reading.string()});
    return labels;
  } catch (const std::exception& error) {
    const std::string what = error.what();
    const bool is_named = what.find(reading.string()) != std::string::npos;
    throw std::runtime_error(is_named ? what : fmt::format("{}: {}", reading.string(), what));
  }
}

}  // namespace q3d::pipeline::evaluation
