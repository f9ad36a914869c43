// The lines of verdicts.csv, as they are written. verdicts.h reads them.
#pragma once

#include <cstdint>
#include <string>

#include "manifests/verdict.h"
#include "pipeline/candidates/candidate.h"

namespace q3d::pipeline::dataset {

// The first line.
std::string verdict_header();

// A candidate's line. `row` is the place of its sample in the shard of its unit. Shard and row are those of
// the kept ones; a trust score that was not measured is an empty cell.
std::string verdict_row(const candidates::Candidate& candidate, const manifests::Judgement& judgement,
                        std::int64_t unit, std::int64_t row);

}  // namespace q3d::pipeline::dataset
