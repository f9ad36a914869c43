// How well a prediction fits the annotated keypoints.
#pragma once

#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// Returns L_proj of what predict found, in crop units; NaN where the candidate failed, where no keypoint is
// visible, and where the body has no projection.
double error_of(const PredictedSample& sample, const device::CropKeypoints& keypoints);

}  // namespace q3d::pipeline::unit
