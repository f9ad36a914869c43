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

// Fills work.refined: adapts the candidates that the rule adapts, all of the unit in one call of the network.
// Uses work.features if predict has left them, which gives the same bits as encoding the crops again, and
// frees them. Does nothing if work.refined is set.
void refine_unit(UnitWork& work, const NetworkSource& network, const config::JudgingRules& rules,
                 StepObserver* observer = nullptr);

}  // namespace q3d::pipeline::unit
