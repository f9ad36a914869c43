// Makes statistics.json, which holds all numbers that the report shows.
#pragma once

#include <nlohmann/json.hpp>

#include "pipeline/statistics/facts.h"

namespace q3d::pipeline::statistics {

inline constexpr const char* kStatisticsFormat = "quadruped3d-statistics";
inline constexpr int kStatisticsSchema = 1;

// Returns the document: format, schema, dataset {...}, counts, labels, funnel, reasons, groups, errors,
// adaptation, accuracy, keypoints, visible, sizes, trust, shape, explorer, notes, provenance. docs/report.md
// explains each part. It adds no time, host or path, so equal datasets give equal bytes. Throws like gather,
// and std::runtime_error for a dataset.json that is damaged.
nlohmann::ordered_json statistics(const dataset::PublishedDataset& dataset, const Facts& facts);

}  // namespace q3d::pipeline::statistics
