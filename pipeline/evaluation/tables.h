// Computes means over samples for each dataset, family and species, and measures how well the predicted
// shapes cluster by family.
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
  std::int64_t samples = 0;  // samples with a prediction
  std::int64_t by_mask = 0;  // of these, normalised by a mask; the others by the whole crop
  std::array<MetricMean, kMetricCount> metrics;
};

// Agreement of k-means clusters of shapes with families, over the samples whose family is one of the five.
struct ClusterRow {
  std::string dataset;
  const Setting* setting = nullptr;  // null: the true shapes
  std::int64_t samples = 0;
  std::int64_t families = 0;  // families that occur among these samples
  std::optional<double> ari;  // nothing if there are fewer samples than clusters
};

struct Tables {
  std::vector<TableRow> datasets;
  std::vector<TableRow> families;  // five and "none"; those that occur
  std::vector<TableRow> species;   // "unknown" last; those that occur
  std::vector<ClusterRow> clusters;
};

inline constexpr int kShapeClusters = 5;

// The tables point to the evaluation's settings, so it must outlive them. With options.official_means a
// sample without a value counts as 0 if its dataset has any value of that metric.
Tables make_tables(const Evaluation& evaluation);

}  // namespace q3d::pipeline::evaluation
