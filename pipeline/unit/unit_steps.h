// The work on one unit, step by step: decode, predict, judge, refine. Each step looks only at its unit, so a
// unit's result does not depend on threads, on its neighbours, or on where an earlier run ended.
#pragma once

#include <functional>

#include "pipeline/config/judging_rules.h"
#include "pipeline/device/network.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// A candidate's keypoints in the network's crop. Needs no picture.
device::CropKeypoints crop_keypoints(const manifests::SampleRecord& record);

// What the steps to come need of one candidate's picture.
struct Wanted {
  bool patch = false;
  bool stored_crop = false;
  bool mask_area = false;   // of the patch; comes with it
  bool patch_mask = false;  // likewise
};

// One candidate's picture: decoded, checked, cropped. A bad picture is a failure in the result.
DecodedSample decode_sample(const manifests::SampleRecord& record, Wanted want,
                            const config::ShardConfig& shards);

// Decodes (in parallel) the pictures that the steps to come need: all of them before predict, the middle band
// before refine, the kept ones before measuring against masks and before writing a shard. `rules` may be null
// when only predictions are wanted; then no stored crops are made.
void decode_unit(UnitWork& work, const config::ShardConfig& shards, const config::JudgingRules* rules);

// Gives the network when it is first needed: a unit without pseudo labels needs none.
using NetworkSource = std::function<device::Network&()>;

// Predicts every decoded candidate of role `pseudo` in batches inside the unit; a NaN is a failed sample. The
// others get the body that their annotation gives, or none.
void predict_unit(UnitWork& work, const NetworkSource& network);

// Fills work.judgements from what is known: failures, bands, adaptation curves and measured labels where
// there are any. What is no pseudo label is retained as it came; L_proj of a truth, where it has a
// projection, is its final error.
void judge_unit(UnitWork& work, const config::JudgingRules& rules);

// Adapts the middle band in batches inside the unit. Features are recomputed from the crops, so a resumed
// build gives the same bits as one in a single go.
void refine_unit(UnitWork& work, const NetworkSource& network, const config::JudgingRules& rules);

// How a candidate of the middle band is adapted under the rules: iterations by its error and visible
// keypoints, and the keypoints that it does not see. `patch` must outlive the request.
device::AdaptRequest adapt_request(const manifests::SampleRecord& record, device::PatchView patch,
                                   double error, const filters::Thresholds& thresholds,
                                   const config::GuardConfig& guards);

// The verdict on a candidate that was adapted by adapt_request, before any bound: by its curve, and by the
// held-out one where there is one.
manifests::Judgement judge_refined(const manifests::SampleRecord& record, double error,
                                   const RefinedSample& refined, const filters::Thresholds& thresholds,
                                   const config::GuardConfig& guards);

int visible_keypoints(const device::CropKeypoints& keypoints);  // of weight > 0

// The initial L_proj of a predicted candidate; NaN when it failed or its role is not `pseudo`.
double initial_error(const candidates::Candidate& candidate, const PredictedSample& predicted);

}  // namespace q3d::pipeline::unit
