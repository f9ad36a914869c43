// The step that adapts the predictions of the middle band.
#pragma once

#include <string>

#include "filters/fidelity.h"
#include "pipeline/config/judging_rules.h"
#include "pipeline/unit/network_source.h"
#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// Returns how a candidate of the middle band is adapted: its iterations, which depend on its L_proj and its
// visible keypoints, and the keypoints that the objective does not see. The latter are drawn by the sample's
// id. `error` is L_proj in crop units;
// `patch` must outlive the request. Throws std::invalid_argument if `error` lies outside the middle band.
device::AdaptRequest adapt_request(const std::string& id, const device::CropKeypoints& keypoints,
                                   device::PatchView patch, double error,
                                   const filters::Thresholds& thresholds, const config::GuardConfig& guards);

// Fills work.refined: adapts the middle band in batches inside the unit. The image features are computed
// again from the crops, so that a resumed build gives the same bits as a build in one go. Does nothing if
// work.refined is there.
void refine_unit(UnitWork& work, const NetworkSource& network, const config::JudgingRules& rules);

}  // namespace q3d::pipeline::unit
