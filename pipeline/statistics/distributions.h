// Distributions show how the candidates' numbers are spread: errors, adaptation, visible keypoints, sizes.
#pragma once

#include <nlohmann/json.hpp>

#include "pipeline/dataset/dataset_manifest.h"
#include "pipeline/statistics/facts.h"

namespace q3d::pipeline::statistics {

// Returns a histogram of the predictions' L_proj by verdict: {low, high, beyond, counts: {retained: [...],
// refined, discarded, failed}, final_counts: of the labels}. The bins end where they include 98 % of the
// errors and every threshold. Null if no prediction was judged.
nlohmann::ordered_json error_histogram(const Facts& facts, const dataset::DatasetManifest& manifest);

// Returns at most `most` of the adapted candidates, evenly spread: {adapted, shown, iterations,
// best_iteration, gain, before, after, kept: [...]}. It is null if none was adapted.
nlohmann::ordered_json adaptation(const Facts& facts, std::size_t most = 2500);

// Counts how many candidates, and how many kept ones, have 0 to 26 visible keypoints.
nlohmann::ordered_json visible_keypoints(const Facts& facts);

// Returns a histogram of the kept labels' combined trust with 20 bins from 0 to 1: {low, high, beyond,
// counts}. Null if none was measured.
nlohmann::ordered_json trust_histogram(const Facts& facts);

// Returns widths and heights of pictures, and the longer sides of boxes, in px: quantiles {min, q05, q25,
// median, q75, q95, max} and a histogram of the boxes' longer sides with 30 bins. Boxes below the crop of the
// network (256 px) are enlarged for it; `boxes_below_crop` counts them.
nlohmann::ordered_json sizes(const Facts& facts);

}  // namespace q3d::pipeline::statistics
