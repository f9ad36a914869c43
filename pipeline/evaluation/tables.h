// Means over samples: per dataset, family and species, and how well the predicted shapes cluster by family.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/evaluation/evaluate.h"

namespace q3d::pipeline::evaluation {

// One row of a table: a group of samples of one dataset under one setting.
struct TableRow {
  std::string dataset;  // name/split
  std::string group;    // a family or a species; empty in the table of datasets
  const Setting* setting = nullptr;
  std::int64_t samples = 0;  // with a prediction
  std::int64_t by_mask = 0;  // of these, normalised by a mask; the others by the whole crop
  std::array<MetricMean, kMetricCount> metrics;
};

// Agreement of k-means clusters of shapes with families, over the samples whose family is one of the five.
struct ClusterRow {
  std::string dataset;
  const Setting* setting = nullptr;  // null: the true shapes
  std::int64_t samples = 0;
  std::int64_t families = 0;  // that occur among them
  std::optional<double> ari;  // nothing when there are fewer samples than clusters
};

struct Tables {
  std::vector<TableRow> datasets;
  std::vector<TableRow> families;  // five and "none"; those that occur
  std::vector<TableRow> species;   // "unknown" last; those that occur
  std::vector<ClusterRow> clusters;
};

inline constexpr int kShapeClusters = 5;

// Settings are referred to, so the evaluation must outlive the tables. With options.official_means a sample
// without a value counts as 0, where its dataset has any value of that metric.
Tables make_tables(const Evaluation& evaluation);

}  // namespace q3d::pipeline::evaluation
