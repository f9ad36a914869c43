#include "pipeline/evaluation/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

#include "pipeline/evaluation/text_table.h"
#include "pipeline/run/version.h"

namespace q3d::pipeline::evaluation {
namespace {

using Evaluations = std::vector<const StoredEvaluation*>;
using ById = std::map<std::string, const StoredSample*>;

// The paired samples of one dataset: first all runs of `before`, then all of `after`.
class PairedSamples {
 public:
  explicit PairedSamples(const std::vector<const std::vector<StoredSample>*>& runs) {
    for (const auto* run : runs) {
      ById& by_id = runs_.emplace_back();
      for (const StoredSample& sample : *run) {
        by_id[sample.id] = &sample;
        ids_.insert(sample.id);
      }
    }
    for (const std::string& id : ids_) require_one_normaliser(id);
  }

  // Returns nothing if no sample has the metric.
  std::optional<ComparisonRow> row(Metric metric, const filters::BootstrapOptions& bootstrap) const {
    const std::size_t pairs = runs_.size() / 2;
    ComparisonRow row;
    row.metric = metric;
    std::vector<std::vector<double>> values(runs_.size());  // by run, of the paired samples
    std::map<std::string, std::size_t> pictures;
    std::vector<std::size_t> picture_of_sample;
    for (const std::string& id : ids_) {
      const std::vector<double> of_runs = values_of(id, metric);
      if (of_runs.empty()) continue;
      if (of_runs.size() < runs_.size()) {
        ++row.unpaired;
        continue;
      }
      for (std::size_t r = 0; r < runs_.size(); ++r) values[r].push_back(of_runs[r]);
      picture_of_sample.push_back(pictures.emplace(picture_of(id), pictures.size()).first->second);
    }
    if (picture_of_sample.empty()) return std::nullopt;
    const std::size_t samples = picture_of_sample.size();
    std::vector<double> differences;
    for (std::size_t p = 0; p < pairs; ++p) {
      for (std::size_t i = 0; i < samples; ++i) {
        differences.push_back(values[pairs + p][i] - values[p][i]);
        row.before += values[p][i] / static_cast<double>(pairs * samples);
        row.after += values[pairs + p][i] / static_cast<double>(pairs * samples);
      }
    }
    row.samples = static_cast<std::int64_t>(samples);
    row.pictures = static_cast<std::int64_t>(pictures.size());
    row.difference = filters::paired_bootstrap(differences, picture_of_sample, bootstrap);
    row.finding = finding(row.difference, kMetrics[index_of(metric)].higher_is_better);
    return row;
  }

 private:
  void require_one_normaliser(const std::string& id) const {
    std::set<std::string> normalisers;
    for (const ById& run : runs_) {
      if (const auto found = run.find(id); found != run.end()) normalisers.insert(found->second->normaliser);
    }
    if (normalisers.size() > 1) {
      throw std::runtime_error(fmt::format(
          "{} is normalised by its mask in one evaluation and by the whole crop in another: their "
          "AUC and PCK have different scales; evaluate both with the same masks",
          id));
    }
  }

  std::vector<double> values_of(const std::string& id, Metric metric) const {
    std::vector<double> values;
    for (const ById& run : runs_) {
      const auto found = run.find(id);
      if (found == run.end()) continue;
      if (const auto& value = found->second->values[index_of(metric)]) values.push_back(*value);
    }
    return values;
  }

  std::vector<ById> runs_;
  std::set<std::string> ids_;
};

class Comparer {
 public:
  Comparer(Evaluations evaluations, std::size_t pairs, const CompareOptions& options)
      : evaluations_(std::move(evaluations)) {
    comparison_.pairs = pairs;
    comparison_.options = options;
  }

  Comparison run() {
    const auto settings = settings_to_compare();
    for (const std::string& dataset : common_datasets()) {
      require_equal_inputs(dataset);
      for (const auto& [before, after] : settings) add_rows(dataset, before, after);
    }
    if (comparison_.rows.empty()) {
      throw std::runtime_error("the evaluations have no dataset, setting and sample in common");
    }
    return std::move(comparison_);
  }

 private:
  std::vector<std::pair<std::string, std::string>> settings_to_compare() {
    const CompareOptions& options = comparison_.options;
    if (options.before_setting.empty() != options.after_setting.empty()) {
      throw std::invalid_argument("give a setting for both sides, or for none");
    }
    if (!options.before_setting.empty()) {
      for (std::size_t i = 0; i < evaluations_.size(); ++i) {
        require_setting(*evaluations_[i],
                        i < comparison_.pairs ? options.before_setting : options.after_setting);
      }
      return {{options.before_setting, options.after_setting}};
    }
    std::vector<std::pair<std::string, std::string>> settings;
    for (const std::string& name : evaluations_.front()->setting_names) {
      if (in_all([&](const StoredEvaluation& each) { return has_setting(each, name); })) {
        settings.emplace_back(name, name);
      } else {
        comparison_.notes.push_back("the setting \"" + name + "\" is not in every evaluation");
      }
    }
    return settings;
  }

  static bool has_setting(const StoredEvaluation& evaluation, const std::string& name) {
    const auto& names = evaluation.setting_names;
    return std::find(names.begin(), names.end(), name) != names.end();
  }

  static void require_setting(const StoredEvaluation& evaluation, const std::string& name) {
    if (has_setting(evaluation, name)) return;
    std::string names;
    for (const std::string& each : evaluation.setting_names) names += (names.empty() ? "" : ", ") + each;
    throw std::invalid_argument(
        fmt::format("{} has no setting \"{}\"; it has: {}", evaluation.folder, name, names));
  }

  template <typename Predicate>
  bool in_all(const Predicate& predicate) const {
    return std::all_of(evaluations_.begin(), evaluations_.end(),
                       [&](const StoredEvaluation* each) { return predicate(*each); });
  }

  std::vector<std::string> common_datasets() {
    std::vector<std::string> common;
    std::set<std::string> noted;
    for (const StoredEvaluation* evaluation : evaluations_) {
      for (const std::string& name : evaluation->dataset_names) {
        if (!noted.insert(name).second) continue;
        if (in_all([&](const StoredEvaluation& each) { return each.datasets.count(name) > 0; })) {
          common.push_back(name);
        } else {
          comparison_.notes.push_back("the dataset " + name + " is not in every evaluation");
        }
      }
    }
    return common;
  }

  void require_equal_inputs(const std::string& dataset) const {
    const StoredDataset& first = evaluations_.front()->datasets.at(dataset);
    for (const StoredEvaluation* evaluation : evaluations_) {
      const StoredDataset& other = evaluation->datasets.at(dataset);
      if (other.annotations_sha256 == first.annotations_sha256 && other.truth_sha256 == first.truth_sha256)
        continue;
      throw std::runtime_error(
          fmt::format("{}: {} and {} were measured against different annotation or truth files", dataset,
                      evaluations_.front()->folder, evaluation->folder));
    }
  }

  void add_rows(const std::string& dataset, const std::string& before, const std::string& after) {
    static const std::vector<StoredSample> kNone;  // used if every sample of a setting was left out
    std::vector<const std::vector<StoredSample>*> runs;
    for (std::size_t i = 0; i < evaluations_.size(); ++i) {
      const auto& settings = evaluations_[i]->datasets.at(dataset).settings;
      const auto found = settings.find(i < comparison_.pairs ? before : after);
      runs.push_back(found == settings.end() ? &kNone : &found->second);
    }
    const PairedSamples samples(runs);
    for (const MetricInfo& info : kMetrics) {
      auto row = samples.row(info.metric, comparison_.options.bootstrap);
      if (!row) continue;
      row->dataset = dataset;
      row->before_setting = before;
      row->after_setting = after;
      comparison_.rows.push_back(std::move(*row));
    }
  }

  Evaluations evaluations_;  // all of before, then all of after
  Comparison comparison_;
};

std::string settings_name(const ComparisonRow& row) {
  if (row.before_setting == row.after_setting) return row.before_setting;
  return row.before_setting + " -> " + row.after_setting;
}

}  // namespace

Comparison compare(const std::vector<StoredEvaluation>& before, const std::vector<StoredEvaluation>& after,
                   const CompareOptions& options) {
  require_pairs(before.size(), after.size(), "evaluations");
  Evaluations all;
  for (const auto* side : {&before, &after}) {
    for (const StoredEvaluation& evaluation : *side) all.push_back(&evaluation);
  }
  return Comparer(std::move(all), before.size(), options).run();
}

nlohmann::ordered_json to_json(const Comparison& comparison, const std::vector<StoredEvaluation>& before,
                               const std::vector<StoredEvaluation>& after) {
  using nlohmann::ordered_json;
  const auto sides = [](const std::vector<StoredEvaluation>& side) {
    ordered_json list = ordered_json::array();
    for (const StoredEvaluation& each : side) {
      list.push_back({{"evaluation", each.folder},
                      {"checkpoint", {{"file", each.checkpoint}, {"sha256", each.checkpoint_sha256}}}});
    }
    return list;
  };
  ordered_json rows = ordered_json::array();
  for (const ComparisonRow& row : comparison.rows) {
    ordered_json object = {{"dataset", row.dataset},
                           {"before_setting", row.before_setting},
                           {"after_setting", row.after_setting},
                           {"metric", kMetrics[index_of(row.metric)].key},
                           {"samples", row.samples},
                           {"unpaired", row.unpaired},
                           {"pictures", row.pictures}};
    add_difference(row, object);
    rows.push_back(std::move(object));
  }
  ordered_json document = {{"format", "quadruped3d-comparison"},
                           {"schema", 1},
                           {"toolkit", run::version()},
                           {"before", sides(before)},
                           {"after", sides(after)},
                           {"pairs", comparison.pairs}};
  add_bootstrap(comparison.options.bootstrap, document);
  document["rows"] = std::move(rows);
  document["notes"] = comparison.notes;
  return document;
}

std::string summary_text(const Comparison& comparison) {
  std::vector<std::string> titles{"dataset", "setting", "metric", "samples"};
  append(difference_titles(comparison.options.bootstrap), titles);
  TextTable table(std::move(titles), 3);
  std::string last;
  for (const ComparisonRow& row : comparison.rows) {
    const std::string place = row.dataset + "\n" + settings_name(row);
    const bool same = place == last;
    last = place;
    std::vector<std::string> cells{same ? "" : row.dataset, same ? "" : settings_name(row),
                                   kMetrics[index_of(row.metric)].title, std::to_string(row.samples)};
    append(difference_cells(row), cells);
    table.add(std::move(cells));
  }
  std::string text = table.text();
  for (const std::string& note : comparison.notes) text += "note: " + note + "\n";
  return text;
}

}  // namespace q3d::pipeline::evaluation
