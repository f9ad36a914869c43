// Computes the annotated keypoints of a candidate in the network's crop.
#pragma once

#include "manifests/sample.h"
#include "pipeline/device/network.h"

namespace q3d::pipeline::unit {

// Returns the record's keypoints in the crop that the network sees. The function needs no picture.
device::CropKeypoints crop_keypoints(const manifests::SampleRecord& record);

// Returns how many keypoints have a weight above 0.
int visible_keypoints(const device::CropKeypoints& keypoints);

}  // namespace q3d::pipeline::unit
