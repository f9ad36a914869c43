#include "pipeline/evaluation/label_files.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <charconv>
#include <stdexcept>

#include "manifests/atomic_file.h"
#include "manifests/verdict.h"
#include "pipeline/evaluation/csv.h"

namespace q3d::pipeline::evaluation {
namespace {

namespace fs = std::filesystem;
using manifests::Verdict;
using nlohmann::json;

std::size_t column(const CsvRow& header, const std::string& name) {
  const auto found = std::find(header.begin(), header.end(), name);
  if (found == header.end()) throw std::invalid_argument("the column \"" + name + "\" is missing");
  return static_cast<std::size_t>(found - header.begin());
}

std::optional<double> parse_number(const std::string& text) {
  if (text.empty()) return std::nullopt;
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) {
    throw std::invalid_argument("got \"" + text + "\", expected a number or nothing");
  }
  return value;
}

std::vector<StoredLabel> read_candidates(const std::vector<CsvRow>& rows) {
  if (rows.empty()) throw std::invalid_argument("the file is empty");
  const std::size_t id = column(rows[0], "id");
  const std::size_t verdict = column(rows[0], "verdict");
  std::vector<StoredLabel> labels;
  for (std::size_t r = 1; r < rows.size(); ++r) {
    StoredLabel& label = labels.emplace_back();
    label.id = rows[r][id];
    const Verdict judged = manifests::verdict_from_string(rows[r][verdict]);
    label.kept = judged == Verdict::retained || judged == Verdict::refined;
    for (const MetricInfo& info : kMetrics) {
      label.values[index_of(info.metric)] =
          parse_number(rows[r][column(rows[0], fmt::format("label_{}", info.key))]);
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
