// Counts candidates and labels by dataset, family and species.
#pragma once

#include <nlohmann/json.hpp>

#include "pipeline/dataset/dataset_manifest.h"
#include "pipeline/statistics/facts.h"

namespace q3d::pipeline::statistics {

// Returns how many candidates remain after each step, from all to the kept ones: [{step, count, meaning}].
nlohmann::ordered_json funnel(const Facts& facts);

// Returns [{reason, verdict, count, meaning}] of the discarded and failed candidates, largest first.
nlohmann::ordered_json reasons(const Facts& facts);

// Returns {species: [...], families: [...], datasets: [...], imbalance: {...}}. Each entry of a list, largest
// first:
//   name, family (of a species, that of most of its candidates), candidates, retained, refined, discarded,
//   failed, kept, yield {share, low, high} (kept of candidates, 95 % interval), share_before, share_after (of
//   all candidates, and of all kept), mean_error_before, mean_error_after (of the kept, L_proj)
// imbalance holds max / min of the species' counts before and after, and the same of the families; species
// and families with none are left out of the minimum and counted in `lost`.
nlohmann::ordered_json groups(const Facts& facts);

}  // namespace q3d::pipeline::statistics
