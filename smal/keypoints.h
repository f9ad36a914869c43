// Keypoints in the frame of the network's crop. Those of a source image are manifests::Keypoint, in its
// pixels.
//
// Crop units: the crop's side is 1 and its centre the origin, so the crop reaches from -0.5 to 0.5; x points
// right, y down. loaders/pictures/crop.h makes crop keypoints from image keypoints, and nothing else does.
#pragma once

#include <array>

#include "smal/sizes.h"

namespace q3d::smal {

// A keypoint of a body, projected into the crop.
struct CropPoint {
  float x = 0.0F;
  float y = 0.0F;
  bool operator==(const CropPoint&) const = default;
};
using CropPoints = std::array<CropPoint, kNumKeypoints>;

// An annotated keypoint in the crop, with the weight of its annotation.
struct CropKeypoint {
  float x = 0.0F;
  float y = 0.0F;
  float weight = 0.0F;
  bool is_visible() const { return weight > 0.0F; }
  bool operator==(const CropKeypoint&) const = default;
};
using CropKeypoints = std::array<CropKeypoint, kNumKeypoints>;

}  // namespace q3d::smal
