// Writes the lines of verdicts.csv, which verdicts.h reads.
#pragma once

#include <cstdint>
#include <string>

#include "manifests/verdict.h"
#include "pipeline/candidates/candidate.h"

namespace q3d::pipeline::dataset {

// Returns the first line.
std::string verdict_header();

// Returns a candidate's line. `row` is the position of its sample in the shard of its unit. Shard and row are
// empty cells unless the candidate is kept; so is a trust score that was not measured.
std::string verdict_row(const candidates::Candidate& candidate, const manifests::Judgement& judgement,
                        std::int64_t unit, std::int64_t row);

}  // namespace q3d::pipeline::dataset
