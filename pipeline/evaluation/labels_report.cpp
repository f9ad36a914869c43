#include <fmt/format.h>

#include "manifests/atomic_file.h"
#include "manifests/csv.h"
#include "pipeline/evaluation/labels.h"
#include "pipeline/evaluation/report_values.h"
#include "pipeline/evaluation/text_table.h"
#include "pipeline/run/version.h"

namespace q3d::pipeline::evaluation {
namespace {

using manifests::csv_line;
using manifests::CsvRow;
using nlohmann::ordered_json;

ordered_json means_json(const std::array<MetricMean, kMetricCount>& means, bool with_body) {
  ordered_json object = ordered_json::object();
  for (const MetricInfo& info : kMetrics) {
    if (info.needs_body && !with_body) continue;
    const MetricMean& mean = means[index_of(info.metric)];
    object[info.key] = number_or_null(mean.mean);
    object[std::string(info.key) + "_samples"] = mean.samples;
  }
  return object;
}

// Returns a table with the 2D metrics against one kind of keypoints and, if `with_body`, the 3D metrics.
std::string table_text(const std::vector<LabelRow>& rows,
                       std::array<MetricMean, kMetricCount> LabelRow::*means, bool with_body) {
  std::vector<std::string> header{"group", "bodies", "normaliser", "samples"};
  for (const MetricInfo& info : kMetrics) {
    if (with_body || !info.needs_body) header.emplace_back(info.title);
  }
  TextTable table(header, 3);
  for (const LabelRow& row : rows) {
    std::vector<std::string> cells{row.group, row.bodies, normaliser_name(row.by_mask, row.samples),
                                   std::to_string(row.samples)};
    for (const MetricInfo& info : kMetrics) {
      if (!with_body && info.needs_body) continue;
      cells.push_back(cell((row.*means)[index_of(info.metric)].mean, info.decimals));
    }
    table.add(cells);
  }
  return table.text();
}

void append(const MetricValues& values, bool with_body, CsvRow& row) {
  for (const MetricInfo& info : kMetrics) {
    if (with_body || !info.needs_body) row.push_back(number_text(values[index_of(info.metric)]));
  }
}

}  // namespace

ordered_json to_json(const LabelEvaluation& evaluation) {
  ordered_json rows = ordered_json::array();
  for (const LabelRow& row : evaluation.rows) {
    rows.push_back({{"group", row.group},
                    {"bodies", row.bodies},
                    {"samples", row.samples},
                    {"normaliser", normaliser_name(row.by_mask, row.samples)},
                    {"normalised_by_mask", row.by_mask},
                    {"against_annotated", means_json(row.annotated, true)},
                    {"against_true_projections", means_json(row.projected, false)}});
  }
  return {{"format", "quadruped3d-label-evaluation"},
          {"schema", 1},
          {"toolkit", run::version()},
          {"dataset", evaluation.dataset},
          {"content_id", evaluation.content_id},
          {"truth_sha256", evaluation.truth_sha256},
          {"candidates", evaluation.candidates.size()},
          {"failed", evaluation.failed},
          {"without_truth", evaluation.without_truth},
          {"rows", std::move(rows)}};
}

std::string labels_csv(const LabelEvaluation& evaluation) {
  CsvRow header{"id", "verdict", "reason", "normaliser"};
  for (const char* bodies : {"prediction", "label"}) {
    for (const MetricInfo& info : kMetrics) header.push_back(fmt::format("{}_{}", bodies, info.key));
    for (const MetricInfo& info : kMetrics) {
      if (!info.needs_body) header.push_back(fmt::format("{}_true_{}", bodies, info.key));
    }
  }
  std::string text = csv_line(header);
  for (const MeasuredCandidate& candidate : evaluation.candidates) {
    CsvRow row{candidate.id, std::string(manifests::to_string(candidate.verdict)),
               std::string(manifests::to_string(candidate.reason)),
               candidate.normalised_by_mask ? "mask" : "crop"};
    append(candidate.predicted.annotated, true, row);
    append(candidate.predicted.projected, false, row);
    if (candidate.label) {
      append(candidate.label->annotated, true, row);
      append(candidate.label->projected, false, row);
    }
    row.resize(header.size());
    text += csv_line(row);
  }
  return text;
}

std::string summary_text(const LabelEvaluation& evaluation) {
  std::string text = "against the annotated keypoints, which adaptation saw, and the true bodies:\n";
  text += table_text(evaluation.rows, &LabelRow::annotated, true);
  text += "\nagainst the true bodies' projections, hidden points included:\n";
  text += table_text(evaluation.rows, &LabelRow::projected, false);
  text += fmt::format("\n{} candidates measured, {} without a truth; {} failed before that\n",
                      evaluation.candidates.size(), evaluation.without_truth, evaluation.failed);
  return text + "AUC and PCK in percent, L_proj in crop units, PA in mm.\n";
}

void write_label_evaluation(const std::filesystem::path& folder, const LabelEvaluation& evaluation) {
  std::filesystem::create_directories(folder);
  manifests::write_file_atomically(folder / "labels.csv", labels_csv(evaluation));
  manifests::write_file_atomically(folder / "labels.json", to_json(evaluation).dump(2) + "\n");
}

}  // namespace q3d::pipeline::evaluation
