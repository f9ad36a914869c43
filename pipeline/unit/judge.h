// The step that judges a unit: the fidelity rule, the guards' bounds, and what the user leaves out.
#pragma once

#include "filters/fidelity.h"
#include "pipeline/config/judging_rules.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// Returns L_proj of a candidate's prediction in crop units. It is NaN if the candidate failed or if its role
// is not `pseudo`.
double initial_error(const candidates::Candidate& candidate, const PredictedSample& predicted);

// Returns the verdict on a candidate that was adapted by adapt_request (refine.h), before any bound is
// applied. It depends on the candidate's curve, and on the held-out curve where there is one.
manifests::Judgement judge_refined(const manifests::SampleRecord& record, double error,
                                   const RefinedSample& refined, const filters::Thresholds& thresholds,
                                   const config::GuardConfig& guards);

// Fills work.judgements from what is known: failures, bands, adaptation curves and measured labels where
// there are any. A label that does not come from the network is retained as it is; if it has a projection,
// its L_proj becomes the final error. Throws std::out_of_range for a pseudo label whose dataset has no
// thresholds.
void judge_unit(UnitWork& work, const config::JudgingRules& rules);

// Returns whether the candidate's label goes into the dataset.
bool is_kept(const manifests::Judgement& judgement);

}  // namespace q3d::pipeline::unit
