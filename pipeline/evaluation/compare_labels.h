// `compare-labels`: tests whether one set of rules keeps more accurate labels than another, at equal yield.
#pragma once

#include <nlohmann/json.hpp>

#include <string>
#include <vector>

#include "filters/bootstrap.h"
#include "pipeline/evaluation/difference.h"
#include "pipeline/evaluation/label_files.h"

namespace q3d::pipeline::evaluation {

// A pair of builds over the same pool.
struct LabelPair {
  std::int64_t candidates = 0;   // candidates with a prediction
  std::int64_t kept_before = 0;  // kept labels before any cut
  std::int64_t kept_after = 0;
  std::int64_t equal = 0;  // labels of each side at equal yield
  std::int64_t both = 0;   // labels of these that both sides have
};

// The means are taken over all labels of a side that have a value.
struct LabelComparisonRow : ComparedMeans {
  std::string group;                // "equal yield", "kept by both" (of equal yield), "all kept"
  std::int64_t samples_before = 0;  // samples with a value, over all pairs
  std::int64_t samples_after = 0;
};

struct LabelComparison {
  filters::BootstrapOptions bootstrap;
  std::vector<LabelPair> pairs;
  std::vector<LabelComparisonRow> rows;
};

// before[i] and after[i] are a pair: two builds over one pool. At equal yield, the larger set is cut to the
// size of the smaller one, those of largest L_proj first (of equal ones, the later id), so the paper's own
// measure replaces the guards there. Compares PA-MPJPE and PA-MPVPE. Intervals come from
// filters::bootstrap_of_sets over the pool's pictures and the pairs. Throws std::invalid_argument if the
// lists have different lengths, and std::runtime_error if the builds of a pair have different candidates or
// truths, or if no label has a truth.
LabelComparison compare_labels(const std::vector<StoredLabels>& before,
                               const std::vector<StoredLabels>& after,
                               const filters::BootstrapOptions& options);

nlohmann::ordered_json to_json(const LabelComparison& comparison, const std::vector<StoredLabels>& before,
                               const std::vector<StoredLabels>& after);
std::string summary_text(const LabelComparison& comparison);

}  // namespace q3d::pipeline::evaluation
