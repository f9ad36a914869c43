// The work on one unit, step by step: decode, predict, judge, refine. Each step looks only at its unit, so a
// unit's result does not depend on threads, on its neighbours, or on where an earlier run ended.
#pragma once

#include "filters/fidelity.h"
#include "pipeline/build_config.h"
#include "pipeline/network.h"
#include "pipeline/unit_work.h"

namespace q3d::pipeline {

// A candidate's keypoints in the network's crop. Needs no picture.
CropKeypoints crop_keypoints(const manifests::SampleRecord& record);

// What the steps to come need of one candidate's picture.
struct Wanted {
  bool patch = false;
  bool stored_crop = false;
  bool mask_area = false;  // of the patch; comes with it
};

// One candidate's picture: decoded, checked, cropped. A bad picture is a failure in the result.
DecodedSample decode_sample(const manifests::SampleRecord& record, Wanted want, const ShardConfig& shards);

// Decodes (in parallel) the pictures that the steps to come need: all of them before predict, the middle band
// before refine, the kept ones before writing a shard. `thresholds` may be null when only predictions are
// wanted; then no stored crops are made.
void decode_unit(UnitWork& work, const ShardConfig& shards, const filters::Thresholds* thresholds);

// Predicts every decoded candidate in batches inside the unit. A NaN is a failed sample.
void predict_unit(UnitWork& work, Network& network);

// Fills work.judgements from what is known: failures, bands, and adaptation curves where there are any.
void judge_unit(UnitWork& work, const filters::Thresholds& thresholds);

// Adapts the middle band in batches inside the unit. Features are recomputed from the crops, so a resumed
// build gives the same bits as one in a single go.
void refine_unit(UnitWork& work, Network& network, const filters::Thresholds& thresholds);

// The initial L_proj of a predicted candidate; NaN when it failed.
double initial_error(const Candidate& candidate, const PredictedSample& predicted);

}  // namespace q3d::pipeline
