// The tables that the stages predict, refine, measure and crops write for one unit.
#pragma once

#include <span>
#include <vector>

#include "manifests/table.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// The table holds the predictions and, for each, the candidate's id, picture, box and keypoints.
manifests::Table to_table(std::span<const candidates::Candidate> candidates,
                          const std::vector<PredictedSample>& samples);
manifests::Table to_table(const std::vector<RefinedSample>& samples);
manifests::Table to_table(const std::vector<MeasuredLabel>& labels);
// The table refers to the bytes of the crops, which must outlive it.
manifests::Table to_table(const std::vector<EncodedCrop>& crops);

// These throw std::runtime_error if a column is missing or has another type.
std::vector<PredictedSample> predicted_from_table(const manifests::Table& table);
// Returns one candidate's id, image_ref, box and keypoints; the rest of the record is not set.
manifests::SampleRecord candidate_from_table(const manifests::Table& table, std::size_t row);
std::vector<RefinedSample> refined_from_table(const manifests::Table& table);
std::vector<MeasuredLabel> measured_from_table(const manifests::Table& table);
// Moves the bytes out of the table. Also throws if the positions do not ascend.
std::vector<EncodedCrop> crops_from_table(manifests::Table table);

}  // namespace q3d::pipeline::unit
