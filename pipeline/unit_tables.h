// What predict, refine and measure put on disk for one unit, as tables.
#pragma once

#include <vector>

#include "manifests/table.h"
#include "pipeline/unit_work.h"

namespace q3d::pipeline {

manifests::Table to_table(const std::vector<PredictedSample>& samples);
manifests::Table to_table(const std::vector<RefinedSample>& samples);
manifests::Table to_table(const std::vector<MeasuredLabel>& labels);

// Throw std::runtime_error when a column is missing or has another type.
std::vector<PredictedSample> predicted_from_table(const manifests::Table& table);
std::vector<RefinedSample> refined_from_table(const manifests::Table& table);
std::vector<MeasuredLabel> measured_from_table(const manifests::Table& table);

}  // namespace q3d::pipeline
