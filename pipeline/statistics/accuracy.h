// Measures how well predictions and labels fit the annotated keypoints.
#pragma once

#include <nlohmann/json.hpp>

#include "pipeline/statistics/facts.h"

namespace q3d::pipeline::statistics {

// Returns {normaliser: "crop", thresholds: [...], predictions, labels, labels_before}. Each of the last three
// is {samples, auc (mean over samples, %), pck: [mean over samples, % at each threshold]}. `predictions`
// covers all judged candidates, `labels` the kept bodies, and `labels_before` the predictions of the same
// candidates as `labels`. Thresholds are fractions of the crop's side. As in L_proj, a keypoint is either
// visible or not; its confidence is not used. A part is null if it has no samples.
nlohmann::ordered_json accuracy(const Facts& facts);

// Returns [{name, visible (candidates), kept (labels in which it is visible), error_before, error_after (mean
// distance over those labels, crop units)}] for the 26 keypoints.
nlohmann::ordered_json keypoint_table(const Facts& facts);

}  // namespace q3d::pipeline::statistics
