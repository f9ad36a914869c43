// Converts the body of an annotation file to the form of the network's predictions.
#pragma once

#include <string>

#include "manifests/sample.h"
#include "pipeline/device/network.h"

namespace q3d::pipeline::unit {

// The least depth, in SMAL units, at which points of a truth count as lying in front of the crop's camera. An
// animal that fits into the picture is some ten units away; files without a translation put it at the camera
// itself.
inline constexpr float kNearestDepth = 0.1F;

// Returns the annotated body. Rotations are computed by Rodrigues' formula in double. Betas, translation and
// 3D keypoints are copied, or zeros if the file has none. camera = (2 f / (256 trans_z), trans_x, trans_y),
// and the projection is that of keypoints_3d + trans. Both are NaN if the translation or a keypoint is nearer
// than kNearestDepth, and the projection is NaN if the file has no 3D keypoints.
device::BodyPrediction annotated_body(const manifests::BodyTruth& truth);

// Returns the body of a sample without one: zeros, with camera and projection NaN.
device::BodyPrediction no_body();

// Returns whether keypoints_2d holds a projection.
bool has_projection(const smal::CropPoints& keypoints_2d);

// Says in words which parts the label of a truth will lack. Returns "" if it lacks none.
std::string missing_parts(const manifests::BodyTruth& truth);

}  // namespace q3d::pipeline::unit
