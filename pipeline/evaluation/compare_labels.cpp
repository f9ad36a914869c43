#include "pipeline/evaluation/compare_labels.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "pipeline/evaluation/text_table.h"
#include "pipeline/run/version.h"

namespace q3d::pipeline::evaluation {
namespace {

using Kept = std::map<std::string, const StoredLabel*>;  // by id

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

Kept kept_labels(const StoredLabels& labels) {
  Kept kept;
  for (const StoredLabel& label : labels.candidates) {
    if (label.kept) kept[label.id] = &label;
  }
  return kept;
}

// Returns the `count` labels of least L_proj.
Kept cut(const Kept& kept, std::size_t count) {
  std::vector<std::pair<double, std::string>> order;
  for (const auto& [id, label] : kept) {
    const auto& error = label->values[index_of(Metric::l_proj)];
    if (!error) throw std::runtime_error(id + " is kept and has no L_proj");
    order.emplace_back(*error, id);
  }
  std::sort(order.begin(), order.end());
  order.resize(std::min(count, order.size()));
  Kept result;
  for (const auto& [error, id] : order) result[id] = kept.at(id);
  return result;
}

void require_one_pool(const StoredLabels& before, const StoredLabels& after) {
  if (before.truth_sha256 != after.truth_sha256) {
    throw std::runtime_error(
        fmt::format("{} and {} were measured against different truth files", before.folder, after.folder));
  }
  std::set<std::string> ids;
  for (const StoredLabel& label : before.candidates) ids.insert(label.id);
  const bool has_all = std::all_of(after.candidates.begin(), after.candidates.end(),
                                   [&](const StoredLabel& label) { return ids.count(label.id) > 0; });
  if (has_all && before.candidates.size() == after.candidates.size()) return;
  throw std::runtime_error(
      fmt::format("{} ({} candidates) and {} ({}) judge different pools; a pair is two builds over the same "
                  "candidates with the same network",
                  before.folder, before.candidates.size(), after.folder, after.candidates.size()));
}

// The labels that are compared, for each pair.
struct Sets {
  std::vector<Kept> before;
  std::vector<Kept> after;
};

// Numbers all items of a pool and their pictures.
class Items {
 public:
  explicit Items(const std::vector<StoredLabels>& pools) {
    std::map<std::string, std::size_t> pictures;
    for (const StoredLabels& pool : pools) {
      for (const StoredLabel& label : pool.candidates) {
        if (!numbers_.emplace(label.id, numbers_.size()).second) continue;
        picture_of_item_.push_back(pictures.emplace(picture_of(label.id), pictures.size()).first->second);
      }
    }
  }
  const std::vector<std::size_t>& pictures() const { return picture_of_item_; }

  // Returns runs x items values, NaN where an item is not kept or has no such value.
  std::vector<double> values(const std::vector<Kept>& runs, Metric metric) const {
    std::vector<double> values(runs.size() * numbers_.size(), kNone);
    for (std::size_t r = 0; r < runs.size(); ++r) {
      for (const auto& [id, label] : runs[r]) {
        const auto& value = label->values[index_of(metric)];
        if (value) values[r * numbers_.size() + numbers_.at(id)] = *value;
      }
    }
    return values;
  }

 private:
  std::map<std::string, std::size_t> numbers_;  // by id
  std::vector<std::size_t> picture_of_item_;
};

// Returns the number and the mean of the values that are not NaN.
std::pair<std::int64_t, double> count_and_mean(const std::vector<double>& values) {
  std::int64_t count = 0;
  double sum = 0.0;
  for (const double value : values) {
    if (std::isnan(value)) continue;
    ++count;
    sum += value;
  }
  return {count, sum / static_cast<double>(count)};
}

void add_rows(const std::string& group, const Sets& sets, const Items& items, LabelComparison& comparison) {
  for (const Metric metric : {Metric::pa_mpjpe, Metric::pa_mpvpe}) {
    const std::vector<double> before = items.values(sets.before, metric);
    const std::vector<double> after = items.values(sets.after, metric);
    LabelComparisonRow row;
    row.group = group;
    row.metric = metric;
    std::tie(row.samples_before, row.before) = count_and_mean(before);
    std::tie(row.samples_after, row.after) = count_and_mean(after);
    if (row.samples_before == 0 || row.samples_after == 0) continue;
    row.difference = filters::bootstrap_of_sets(before, after, items.pictures(), comparison.bootstrap);
    row.finding = finding(row.difference, kMetrics[index_of(metric)].higher_is_better);
    comparison.rows.push_back(row);
  }
}

}  // namespace

LabelComparison compare_labels(const std::vector<StoredLabels>& before,
                               const std::vector<StoredLabels>& after,
                               const filters::BootstrapOptions& options) {
  require_pairs(before.size(), after.size(), "label evaluations");
  LabelComparison comparison;
  comparison.bootstrap = options;
  Sets all, equal, both;
  for (std::size_t i = 0; i < before.size(); ++i) {
    require_one_pool(before[i], after[i]);
    all.before.push_back(kept_labels(before[i]));
    all.after.push_back(kept_labels(after[i]));
    const std::size_t size = std::min(all.before[i].size(), all.after[i].size());
    equal.before.push_back(cut(all.before[i], size));
    equal.after.push_back(cut(all.after[i], size));
    both.before.emplace_back();
    both.after.emplace_back();
    for (const auto& [id, label] : equal.before[i]) {
      const auto found = equal.after[i].find(id);
      if (found == equal.after[i].end()) continue;
      both.before[i].emplace(id, label);
      both.after[i].emplace(id, found->second);
    }
    const auto count = [](const auto& set) { return static_cast<std::int64_t>(set.size()); };
    comparison.pairs.push_back({count(before[i].candidates), count(all.before[i]), count(all.after[i]),
                                count(equal.before[i]), count(both.before[i])});
  }
  const Items items(before);
  add_rows("equal yield", equal, items, comparison);
  add_rows("kept by both", both, items, comparison);
  add_rows("all kept", all, items, comparison);
  if (comparison.rows.empty()) {
    throw std::runtime_error(
        "no kept label of both sides has a truth; run `evaluate-labels` with the pool's --truth");
  }
  return comparison;
}

nlohmann::ordered_json to_json(const LabelComparison& comparison, const std::vector<StoredLabels>& before,
                               const std::vector<StoredLabels>& after) {
  using nlohmann::ordered_json;
  const auto side = [](const StoredLabels& labels) -> ordered_json {
    return {{"labels", labels.folder}, {"dataset", labels.dataset}, {"content_id", labels.content_id}};
  };
  ordered_json pairs = ordered_json::array();
  for (std::size_t i = 0; i < comparison.pairs.size(); ++i) {
    const LabelPair& pair = comparison.pairs[i];
    pairs.push_back({{"before", side(before[i])},
                     {"after", side(after[i])},
                     {"candidates", pair.candidates},
                     {"kept_before", pair.kept_before},
                     {"kept_after", pair.kept_after},
                     {"equal_yield", pair.equal},
                     {"kept_by_both", pair.both}});
  }
  ordered_json rows = ordered_json::array();
  for (const LabelComparisonRow& row : comparison.rows) {
    ordered_json object = {{"group", row.group},
                           {"metric", kMetrics[index_of(row.metric)].key},
                           {"samples_before", row.samples_before},
                           {"samples_after", row.samples_after}};
    add_difference(row, object);
    rows.push_back(std::move(object));
  }
  ordered_json document = {{"format", "quadruped3d-label-comparison"},
                           {"schema", 1},
                           {"toolkit", run::version()},
                           {"pairs", std::move(pairs)}};
  add_bootstrap(comparison.bootstrap, document);
  document["rows"] = std::move(rows);
  return document;
}

std::string summary_text(const LabelComparison& comparison) {
  TextTable yields({"pair", "candidates", "kept before", "kept after", "equal yield", "in both"}, 1);
  for (std::size_t i = 0; i < comparison.pairs.size(); ++i) {
    const LabelPair& pair = comparison.pairs[i];
    yields.add({std::to_string(i + 1), std::to_string(pair.candidates), std::to_string(pair.kept_before),
                std::to_string(pair.kept_after), std::to_string(pair.equal), std::to_string(pair.both)});
  }
  std::vector<std::string> titles{"labels", "metric"};
  append(difference_titles(comparison.bootstrap), titles);
  TextTable table(std::move(titles), 2);
  std::string last;
  for (const LabelComparisonRow& row : comparison.rows) {
    std::vector<std::string> cells{row.group == last ? "" : row.group, kMetrics[index_of(row.metric)].title};
    append(difference_cells(row), cells);
    table.add(std::move(cells));
    last = row.group;
  }
  return yields.text() + "\n" + table.text();
}

}  // namespace q3d::pipeline::evaluation
