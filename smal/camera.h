// The camera of the network's crop.
#pragma once

namespace q3d::smal {

inline constexpr int kCropSidePx = 256;     // the side of the square crop that the network sees
inline constexpr double kFocalPx = 1000.0;  // the focal length, quoted for a crop of that side
// The focal length in units of the crop's side. The principal point is the crop's centre.
inline constexpr double kFocalInCropUnits = kFocalPx / kCropSidePx;

// The weak-perspective camera, in the order of the network's output. It corresponds to the translation (tx,
// ty, 2 f / (side s)). Official code: PRIMA.forward_step.
struct Camera {
  float s = 0.0F;
  float tx = 0.0F;
  float ty = 0.0F;
  bool operator==(const Camera&) const = default;
};

}  // namespace q3d::smal
