// The body that an annotation file gives, in the form in which the network's predictions come.
#pragma once

#include <string>

#include "manifests/sample.h"
#include "pipeline/device/network.h"

namespace q3d::pipeline::unit {

// The least depth, in SMAL units, at which a truth's points count as lying before the crop's camera. A whole
// animal in the picture is some ten units away; files without a translation put it at the camera itself.
inline constexpr float kNearestDepth = 0.1F;

// Rotations by Rodrigues' formula, in double; betas, translation and 3D keypoints as they stand (zeros where
// the file has none). camera = (2 f / (256 trans_z), trans_x, trans_y) and the projection of keypoints_3d +
// trans are those of a photograph whose camera the file states: they are NaN where the translation, or a
// keypoint, is nearer than kNearestDepth, and the projection where the file has no 3D keypoints.
device::BodyPrediction annotated_body(const manifests::BodyTruth& truth);

// A sample without a body: zeros, camera and projection NaN.
device::BodyPrediction no_body();

// Returns whether keypoints_2d holds a projection.
bool has_projection(const smal::CropPoints& keypoints_2d);

// Returns what a truth's label will lack, in words. The text is empty when it lacks nothing.
std::string missing_parts(const manifests::BodyTruth& truth);

}  // namespace q3d::pipeline::unit
