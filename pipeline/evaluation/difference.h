// A difference with its bootstrap interval, in words, in JSON and in a table. The comparison of two networks
// and that of two sets of labels share it.
#pragma once

#include <nlohmann/json.hpp>

#include <string>
#include <string_view>
#include <vector>

#include "filters/bootstrap.h"
#include "pipeline/evaluation/metric.h"

namespace q3d::pipeline::evaluation {

enum class Finding { better, worse, no_difference_shown };
std::string_view to_string(Finding finding);  // "better", "worse", "no difference shown"

// Returns better or worse only if the interval of after - before excludes 0.
Finding finding(const filters::BootstrapInterval& difference, bool higher_is_better);

// Throws std::invalid_argument unless `before` and `after` have the same number of `what`, 1 or more.
void require_pairs(std::size_t before, std::size_t after, std::string_view what);

// Returns the picture of a sample, which is its id (dataset/split/picture#annotation) without the annotation.
std::string picture_of(const std::string& sample_id);

// The values that every row of a comparison holds.
struct ComparedMeans {
  Metric metric = Metric::auc;
  double before = 0.0;
  double after = 0.0;
  filters::BootstrapInterval difference;  // after minus before
  Finding finding = Finding::no_difference_shown;
};

// Adds the keys before, after, difference, low, high and finding.
void add_difference(const ComparedMeans& row, nlohmann::ordered_json& object);
// Adds the keys resamples, confidence and seed.
void add_bootstrap(const filters::BootstrapOptions& options, nlohmann::ordered_json& document);

// Returns the titles of a table's last columns: before, after, difference, interval, change % and finding.
std::vector<std::string> difference_titles(const filters::BootstrapOptions& options);
std::vector<std::string> difference_cells(const ComparedMeans& row);

// Appends all of `more`.
void append(std::vector<std::string> more, std::vector<std::string>& cells);

}  // namespace q3d::pipeline::evaluation
