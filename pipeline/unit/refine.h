// The step that adapts predictions: those of the middle band and, with refine_retained, those below it.
#pragma once

#include <string>

#include "filters/fidelity.h"
#include "pipeline/config/judging_rules.h"
#include "pipeline/unit/network_source.h"
#include "pipeline/unit/step_observer.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// Returns how a candidate is adapted: by the rule's schedule (filters/fidelity.h), which the guards may
// shorten where few keypoints are visible, and from which they may hold out keypoints, drawn by the sample's
// id. `error` is L_proj in crop units; `patch` must outlive the request. Throws std::invalid_argument for a
// candidate that the rule does not adapt.
device::AdaptRequest adapt_request(const std::string& id, const device::CropKeypoints& keypoints,
                                   device::PatchView patch, double error,
                                   const filters::Thresholds& thresholds, const config::GuardConfig& guards);

// Fills work.refined: adapts the candidates that the rule adapts, in batches inside the unit. The image
// features are computed again from the crops, so that a resumed build gives the same bits as a build in one
// go. Does nothing if work.refined is there.
void refine_unit(UnitWork& work, const NetworkSource& network, const config::JudgingRules& rules,
                 const Watch& watch = {});

}  // namespace q3d::pipeline::unit
