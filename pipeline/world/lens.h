// A lens applies the effects of a camera, and of later editing, to a picture.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "manifests/random.h"

namespace q3d::pipeline::world {

struct LensHabits {
  double blur_low = 0.4, blur_high = 0.9;    // Gaussian, pixels
  double motion = 0.0;                       // share of pictures smeared by movement
  double noise_low = 1.0, noise_high = 6.0;  // grey levels
  double saturation = 1.0, contrast = 1.0;   // means; every picture differs a little
  double warmth_spread = 0.04;
  double grey = 0.0;                        // share of pictures without colour (infrared)
  double stamped = 0.0;                     // share with a camera's bar of time and temperature
  int quality_low = 75, quality_high = 95;  // JPEG
};

// Changes the picture (BGR, 8 bit) in place. Returns the rectangle of the bar that the camera has stamped
// over it, or an empty one.
cv::Rect expose(cv::Mat& picture, const LensHabits& habits, manifests::Rng& rng);

// Returns JPEG bytes. Throws std::runtime_error if the encoder fails.
std::vector<std::uint8_t> encode_jpeg(const cv::Mat& picture, const LensHabits& habits, manifests::Rng& rng);

}  // namespace q3d::pipeline::world
