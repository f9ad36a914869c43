// Makes the numbers with which the page's threshold explorer judges every candidate again under other
// thresholds.
#pragma once

#include <nlohmann/json.hpp>

#include "pipeline/dataset/dataset_manifest.h"
#include "pipeline/statistics/facts.h"

namespace q3d::pipeline::statistics {

// Returns the judged candidates of role pseudo, column by column, and the results that do not depend on the
// thresholds:
//   thresholds  {dataset: {tau_low, tau_high, delta}}
//   rule        {iterations_min, iterations_max, gain_window, refine_retained, min_trust, guarded}; guarded:
//   a
//               guard is on, so that only candidates whose band and iterations stay the same keep their
//               outcome for sure
//   datasets, species   names, which the columns `dataset` and `group` count into
//   dataset, group, error (initial L_proj, every digit), gain (null: not adapted), iterations,
//   best_iteration, auc_before, auc_after (%, null: no label), kept (0, 1), fixed (1: out whatever the
//   thresholds: vetoed, in a test set, too few keypoints), trust (combined, null: not measured; absent where
//   no label has one)
//   others      {candidates, kept} by species name: failed ones, and those that bring their labels
// The result is null if no candidate was judged. `document` is dataset.json.
nlohmann::ordered_json explorer(const Facts& facts, const dataset::DatasetManifest& manifest,
                                const nlohmann::ordered_json& document);

}  // namespace q3d::pipeline::statistics
