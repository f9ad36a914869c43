// Measures how well a prediction fits the annotated keypoints.
#pragma once

#include "pipeline/unit/unit_work.h"

namespace q3d::pipeline::unit {

// Returns L_proj of a predicted sample, in crop units. It is NaN if the candidate failed, if no keypoint is
// visible, or if the body has no projection.
double error_of(const PredictedSample& sample, const device::CropKeypoints& keypoints);

}  // namespace q3d::pipeline::unit
