// Measures how well predictions and labels fit the annotated keypoints.
#pragma once

#include <nlohmann/json.hpp>

#include "pipeline/statistics/facts.h"

namespace q3d::pipeline::statistics {

// {normaliser: "crop", thresholds: [...], predictions, labels, labels_before}: each of the last three is
// {samples, auc (mean over samples, %), pck: [mean over samples, % at each threshold]}. `predictions` are all
// judged ones, `labels` the kept bodies, and `labels_before` the predictions of the candidates that `labels`
// are of. Thresholds are shares of the crop's side. A keypoint counts as visible or not here, as in L_proj;
// its confidence has no part in it. Null where there are none.
nlohmann::ordered_json accuracy(const Facts& facts);

// [{name, visible (candidates), kept (labels in which it is visible), error_before, error_after (mean
// distance over those labels, crop units)}] for the 26 keypoints.
nlohmann::ordered_json keypoint_table(const Facts& facts);

}  // namespace q3d::pipeline::statistics
