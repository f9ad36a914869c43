#include "pipeline/evaluation/report.h"

#include <fmt/format.h>

#include "manifests/atomic_file.h"
#include "manifests/csv.h"
#include "pipeline/evaluation/report_values.h"
#include "pipeline/evaluation/text_table.h"
#include "pipeline/run/version.h"

namespace q3d::pipeline::evaluation {
namespace {

using manifests::csv_line;
using manifests::CsvRow;
using manifests::Reason;
using nlohmann::ordered_json;

ordered_json row_json(const TableRow& row, const char* group) {
  ordered_json object = {{"dataset", row.dataset}};
  if (group != nullptr) object[group] = row.group;
  object["setting"] = row.setting->name;
  object["uses_test_keypoints"] = row.setting->uses_test_keypoints;
  object["samples"] = row.samples;
  object["normaliser"] = normaliser_name(row.by_mask, row.samples);
  object["normalised_by_mask"] = row.by_mask;
  ordered_json counts = ordered_json::object();
  for (const MetricInfo& info : kMetrics) {
    const MetricMean& metric = row.metrics[index_of(info.metric)];
    object[info.key] = number_or_null(metric.mean);
    counts[info.key] = metric.samples;
  }
  object["samples_of_mean"] = std::move(counts);
  return object;
}

ordered_json rows_json(const std::vector<TableRow>& rows, const char* group) {
  ordered_json list = ordered_json::array();
  for (const TableRow& row : rows) list.push_back(row_json(row, group));
  return list;
}

std::string shapes_of(const ClusterRow& row) {
  return row.setting == nullptr ? "truth" : row.setting->name;
}

ordered_json clusters_json(const std::vector<ClusterRow>& rows) {
  ordered_json list = ordered_json::array();
  for (const ClusterRow& row : rows) {
    list.push_back({{"dataset", row.dataset},
                    {"shapes", shapes_of(row)},
                    {"samples", row.samples},
                    {"families", row.families},
                    {"ari", number_or_null(row.ari)}});
  }
  return list;
}

struct LeftOut {
  std::int64_t samples = 0;
  std::map<std::string, std::int64_t> reasons;
};

LeftOut left_out(const DatasetResult& dataset) {
  LeftOut result;
  for (const SampleResult& sample : dataset.samples) {
    if (sample.failure == Reason::none) continue;
    ++result.samples;
    ++result.reasons[std::string(manifests::to_string(sample.failure))];
  }
  return result;
}

ordered_json dataset_json(const DatasetResult& dataset) {
  const LeftOut out = left_out(dataset);
  ordered_json samples = ordered_json::array();
  for (const SampleResult& sample : dataset.samples) {
    if (sample.failure == Reason::none) continue;
    samples.push_back(
        {{"id", sample.id}, {"reason", manifests::to_string(sample.failure)}, {"detail", sample.detail}});
  }
  const auto taken = static_cast<std::int64_t>(dataset.samples.size());
  return {{"dataset", dataset.name},
          {"annotations_sha256", dataset.annotations_sha256},
          {"truth_sha256",
           dataset.truth_sha256.empty() ? ordered_json(nullptr) : ordered_json(dataset.truth_sha256)},
          {"listed", dataset.listed},
          {"taken", taken},
          {"evaluated", taken - out.samples},
          {"left_out", {{"samples", out.samples}, {"reasons", out.reasons}, {"list", samples}}},
          {"notes", dataset.notes}};
}

ordered_json settings_json(const std::vector<Setting>& settings) {
  ordered_json list = ordered_json::array();
  for (const Setting& setting : settings) {
    list.push_back({{"name", setting.name},
                    {"uses_test_keypoints", setting.uses_test_keypoints},
                    {"iterations", setting.iterations},
                    {"visible_share", setting.visible_share}});
  }
  return list;
}

std::vector<std::string> metric_keys() {
  std::vector<std::string> keys;
  for (const MetricInfo& info : kMetrics) keys.emplace_back(info.key);
  return keys;
}

void add_table_csv(const char* table, const std::vector<TableRow>& rows, std::string& text) {
  for (const TableRow& row : rows) {
    CsvRow fields{table,
                  row.dataset,
                  row.group,
                  row.setting->name,
                  row.setting->uses_test_keypoints ? "1" : "0",
                  std::to_string(row.samples),
                  normaliser_name(row.by_mask, row.samples)};
    for (const MetricMean& metric : row.metrics) {
      fields.push_back(number_text(metric.mean));
      fields.push_back(std::to_string(metric.samples));
    }
    fields.emplace_back();
    text += csv_line(fields);
  }
}

std::string shown_setting(const Setting& setting) {
  return setting.name + (setting.uses_test_keypoints ? " *" : "");
}

std::string table_text(const std::vector<TableRow>& rows, const char* group) {
  std::vector<std::string> header{"dataset"};
  if (group != nullptr) header.emplace_back(group);
  header.insert(header.end(), {"setting", "normaliser", "samples"});
  for (const MetricInfo& info : kMetrics) header.emplace_back(info.title);
  TextTable table(header, group == nullptr ? 3 : 4);
  std::string last_dataset, last_group;
  for (const TableRow& row : rows) {
    const bool same_dataset = row.dataset == last_dataset;
    const bool same_group = same_dataset && row.group == last_group;
    std::vector<std::string> cells{same_dataset ? "" : row.dataset};
    if (group != nullptr) cells.push_back(same_group ? "" : row.group);
    cells.insert(cells.end(), {shown_setting(*row.setting), normaliser_name(row.by_mask, row.samples),
                               std::to_string(row.samples)});
    for (const MetricInfo& info : kMetrics) {
      cells.push_back(cell(row.metrics[index_of(info.metric)].mean, info.decimals));
    }
    table.add(cells);
    last_dataset = row.dataset;
    last_group = row.group;
  }
  return table.text();
}

std::string clusters_text(const std::vector<ClusterRow>& rows) {
  TextTable table({"dataset", "shapes", "samples", "families", "ARI"}, 2);
  std::string last;
  for (const ClusterRow& row : rows) {
    table.add({row.dataset == last ? "" : row.dataset,
               row.setting == nullptr ? "truth" : shown_setting(*row.setting), std::to_string(row.samples),
               std::to_string(row.families), cell(row.ari, 3)});
    last = row.dataset;
  }
  return table.text();
}

std::string left_out_text(const Evaluation& evaluation) {
  std::string text;
  for (const DatasetResult& dataset : evaluation.datasets) {
    const LeftOut out = left_out(dataset);
    if (out.samples == 0) continue;
    text += fmt::format("left out of {}: {} of {}", dataset.name, out.samples, dataset.samples.size());
    const char* separator = " (";
    for (const auto& [reason, count] : out.reasons) {
      text += fmt::format("{}{} {}", separator, count, reason);
      separator = ", ";
    }
    text += ")\n";
  }
  return text;
}

}  // namespace

ordered_json to_json(const Evaluation& evaluation, const Tables& tables) {
  ordered_json datasets = ordered_json::array();
  for (const DatasetResult& dataset : evaluation.datasets) datasets.push_back(dataset_json(dataset));
  return {{"format", kEvaluationFormat},
          {"schema", kEvaluationSchema},
          {"toolkit", run::version()},
          {"checkpoint", {{"file", evaluation.checkpoint}, {"sha256", evaluation.checkpoint_sha256}}},
          {"smal_asset_sha256", evaluation.smal_asset_sha256},
          {"device", evaluation.device_key},
          {"config", evaluation.config},
          {"seed", evaluation.options.seed},
          {"limit", evaluation.options.limit},
          {"official_means", evaluation.options.official_means},
          {"shape_clusters", kShapeClusters},
          {"settings", settings_json(evaluation.settings)},
          {"datasets", std::move(datasets)},
          {"tables",
           {{"datasets", rows_json(tables.datasets, nullptr)},
            {"families", rows_json(tables.families, "family")},
            {"species", rows_json(tables.species, "species")},
            {"clusters", clusters_json(tables.clusters)}}}};
}

std::string samples_csv(const Evaluation& evaluation) {
  CsvRow header{"dataset", "id", "species", "family", "left_out", "setting", "normaliser"};
  for (const std::string& key : metric_keys()) header.push_back(key);
  std::string text = csv_line(header);
  for (const DatasetResult& dataset : evaluation.datasets) {
    for (const SampleResult& sample : dataset.samples) {
      CsvRow start{dataset.name, sample.id, sample.species, std::string(manifests::to_string(sample.family))};
      if (sample.failure != Reason::none) {
        start.emplace_back(manifests::to_string(sample.failure));
        start.resize(header.size());
        text += csv_line(start);
        continue;
      }
      for (std::size_t s = 0; s < evaluation.settings.size(); ++s) {
        CsvRow fields = start;
        fields.insert(fields.end(),
                      {"", evaluation.settings[s].name, sample.normalised_by_mask ? "mask" : "crop"});
        for (const auto& value : sample.values[s]) fields.push_back(number_text(value));
        text += csv_line(fields);
      }
    }
  }
  return text;
}

std::string tables_csv(const Tables& tables) {
  CsvRow header{"table", "dataset", "group", "setting", "uses_test_keypoints", "samples", "normaliser"};
  for (const std::string& key : metric_keys()) header.insert(header.end(), {key, key + "_samples"});
  header.emplace_back("ari");
  std::string text = csv_line(header);
  add_table_csv("dataset", tables.datasets, text);
  add_table_csv("family", tables.families, text);
  add_table_csv("species", tables.species, text);
  for (const ClusterRow& row : tables.clusters) {
    CsvRow fields{"clusters",
                  row.dataset,
                  "",
                  shapes_of(row),
                  row.setting != nullptr && row.setting->uses_test_keypoints ? "1" : "0",
                  std::to_string(row.samples)};
    fields.resize(header.size());
    fields.back() = number_text(row.ari);
    text += csv_line(fields);
  }
  return text;
}

std::string summary_text(const Evaluation& evaluation, const Tables& tables, bool with_species) {
  std::string text = table_text(tables.datasets, nullptr);
  text += "\n" + table_text(tables.families, "family");
  if (with_species) text += "\n" + table_text(tables.species, "species");
  text += fmt::format("\nk-means of the shapes, k = {}, seed {}, against families:\n", kShapeClusters,
                      evaluation.options.seed);
  text += clusters_text(tables.clusters) + "\n";
  text += left_out_text(evaluation);
  text += "AUC and PCK in percent, L_proj in crop units, PA in mm.";
  if (evaluation.options.official_means) text += " Samples without a value count as 0.";
  for (const Setting& setting : evaluation.settings) {
    if (!setting.uses_test_keypoints) continue;
    text += " * uses the test keypoints.";
    break;
  }
  return text + "\n";
}

void write_evaluation(const std::filesystem::path& folder, const Evaluation& evaluation,
                      const Tables& tables) {
  std::filesystem::create_directories(folder);
  manifests::write_file_atomically(folder / "samples.csv", samples_csv(evaluation));
  manifests::write_file_atomically(folder / "tables.csv", tables_csv(tables));
  manifests::write_file_atomically(folder / "evaluation.json", to_json(evaluation, tables).dump(2) + "\n");
}

}  // namespace q3d::pipeline::evaluation
