// The step that judges a unit by the fidelity rule, the guards' bounds, the least trust and the user's
// exclusions.
#pragma once

#include "filters/fidelity.h"
#include "pipeline/config/judging_rules.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// Returns the verdict on a candidate by its prediction alone, before any bound and any exclusion is applied.
// `error` is its L_proj in crop units, or NaN. Throws std::out_of_range for a pseudo label whose dataset has
// no thresholds.
manifests::Judgement judge_predicted(const candidates::Candidate& candidate, const PredictedSample& predicted,
                                     double error, const config::JudgingRules& rules);

// Returns the verdict on a candidate that was adapted by adapt_request (refine.h), before any bound is
// applied. It depends on the candidate's curve, and on the held-out curve where there is one. `error` is
// L_proj of the prediction in crop units.
manifests::Judgement judge_refined(const device::CropKeypoints& keypoints, double error,
                                   const RefinedSample& refined, const filters::Thresholds& thresholds,
                                   const config::GuardConfig& guards);

// Discards a candidate that the user or a test split excludes. It keeps its numbers; a failed one stays
// failed.
void apply_exclusion(const candidates::Exclusion& exclusion, manifests::Judgement& judgement);

// Fills work.judgements from failures, bands, and, where they exist, adaptation curves and measured labels. A
// label that does not come from the network is retained unchanged; if it has a projection, its L_proj becomes
// the final error. Needs work.predicted and work.errors. Throws std::out_of_range for a pseudo label whose
// dataset has no thresholds.
void judge_unit(UnitWork& work, const config::JudgingRules& rules);

// Returns whether the candidate's label goes into the dataset.
bool is_kept(const manifests::Judgement& judgement);

}  // namespace q3d::pipeline::unit
