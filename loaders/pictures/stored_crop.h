// The larger crop that shards store. It has enough context to cut every augmented patch from it with one
// warp.
#pragma once

#include <opencv2/core.hpp>

#include "loaders/pictures/crop.h"

namespace q3d::loaders::pictures {

// This scale covers everything that augmentation can reach. A box that is enlarged 1.3 times and turned by 45
// degrees spans 1.3 sqrt(2) sides, and its centre moves by up to 0.02 sides in each direction: 1.3 sqrt(2) +
// 2 * 0.02 = 1.88.
inline constexpr double kStoredCropScale = 1.9;

struct StoredCrop {
  cv::Mat rgb;          // 8-bit, 3 channels, square; black outside the image
  cv::Mat mask;         // 8-bit, 1 channel; empty when there is none
  Affine from_image{};  // image px -> crop px
};

// Makes a crop that covers `scale` times the box, plus two pixels on each side for the neighbours that the
// warp needs. Its side is min_side_px, or less if the source has fewer pixels there.
//
// If the source has fewer pixels, they are copied unchanged. A patch cut from the crop is then the one cut
// from the image, except for single pixels whose position, a multiple of 1/32 px in OpenCV's warp, is rounded
// the other way. If the source has more pixels, the crop is reduced by area averaging. At 480 px the box
// itself then has 253 px, which is the resolution of the patch (0.69 to 1.28 crop px for a patch px over the
// augmentation's scales), and it does not alias as the official bilinear warp of a large picture does.
//
// Throws std::invalid_argument for wrong image types, a scale below 1, or a side below the patch's.
StoredCrop make_stored_crop(const cv::Mat& rgb, const cv::Mat& mask, const SquareBox& box,
                            double scale = kStoredCropScale, int min_side_px = 480);

// Returns the map from crop px to patch px. It is computed from the map from image px to patch px (augmented
// or not) and the crop's from_image. A training feed cuts its patch with warp_patch(crop.rgb, crop.mask,
// patch_from_stored_crop(...)).
Affine patch_from_stored_crop(const Affine& patch_from_image, const Affine& crop_from_image);

}  // namespace q3d::loaders::pictures
