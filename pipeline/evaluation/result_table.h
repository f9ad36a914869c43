// The results of a unit as a table, so that an evaluation that was stopped goes on, and ranks share one.
#pragma once

#include <cstddef>
#include <span>

#include "manifests/table.h"
#include "pipeline/evaluation/evaluate.h"

namespace q3d::pipeline::evaluation {

// Returns what was measured of some samples under `settings` settings, one row for each sample.
manifests::Table to_table(std::span<const SampleResult> results, std::size_t settings);

// Sets what was measured in the results of the same samples, whose other members are set already. Throws
// std::runtime_error that says what differs if the table has other samples, settings or columns, and
// std::invalid_argument for a reason of no name.
void set_measured(const manifests::Table& table, std::size_t settings, std::span<SampleResult> results);

}  // namespace q3d::pipeline::evaluation
