// A hash of what a picture shows. Resizing, recompression and small changes of colour leave it nearly
// unchanged.
#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "manifests/picture_hash.h"

namespace q3d::loaders::pictures {

// Computes the DCT hash of Zauner ("Implementation and Benchmarking of Perceptual Image Hash Functions",
// 2010). The luma, reduced to 32 x 32 by area averaging, is transformed by a DCT-II. Bit i says whether the
// i-th coefficient in JPEG's zigzag order (without the constant one) is greater than the median of the 64.
// The mirror image's hash comes from the same coefficients, because those of odd horizontal frequency change
// sign.
//
// `rgb`: 8-bit, 3 channels. Returns nothing for a picture of a single colour (a standard deviation below 2 of
// 255 at 32 x 32), because its hash would be noise. Throws std::invalid_argument for another type or an empty
// picture. The hash does not recognise that a picture is a cut-out of another.
std::optional<manifests::PictureHash> perceptual_hash(const cv::Mat& rgb);

}  // namespace q3d::loaders::pictures
