// The network's 256-px patch, bit-exact with the official code (OpenCV 4.x).
#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <span>

#include "loaders/pictures/affine.h"
#include "manifests/sample.h"
#include "smal/camera.h"
#include "smal/keypoints.h"

namespace q3d::loaders::pictures {

inline constexpr int kPatchSidePx = smal::kCropSidePx;

// Mean and standard deviation of ImageNet's colours in [0, 1]. The network's pictures are normalised with
// them.
inline constexpr std::array<double, 3> kImageMean{0.485, 0.456, 0.406};
inline constexpr std::array<double, 3> kImageStd{0.229, 0.224, 0.225};

struct SquareBox {  // pixels of the source image
  double center_x_px = 0.0;
  double center_y_px = 0.0;
  double side_px = 0.0;
};

// Returns the square box of the official TrainDataset: centre (2x + w) // 2, (2y + h) // 2 (floor), side
// max(w, h), at least 1.
SquareBox square_box(const manifests::Box& box);

// Returns the square box of the official EvaluationDataset. It equals square_box(), except that the side is
// computed in float32 as w / 200 * 200, which changes the last bit of some sides (424 becomes 423.99997).
SquareBox evaluation_box(const manifests::Box& box);

// Returns the map from image px to patch px. Official code: gen_trans_from_patch_cv (rotation in degrees).
Affine patch_from_image(const SquareBox& box, int patch_side_px, double scale = 1.0,
                        double rotation_deg = 0.0);

enum class Border { constant, replicate };  // pixels outside the image are black, or repeat its edge

struct Patch {
  cv::Mat rgb;   // 8-bit, 3 channels, kPatchSidePx square
  cv::Mat mask;  // 8-bit, 1 channel: the warped silhouette; all 255 if there is none or no pixel reaches half
  bool has_mask = false;  // whether `mask` is a silhouette
  Affine from_image{};
};

// Cuts a patch with one warp. `rgb` is 8-bit RGB; `mask` is 8-bit grey of the same size, or empty. Outside
// the image the mask is 0 with either border. Official code: generate_image_patch_cv2 and the mask rule of
// TrainDataset. Throws std::invalid_argument for other types or sizes.
Patch warp_patch(const cv::Mat& rgb, const cv::Mat& mask, const Affine& from_image,
                 Border border = Border::constant);

// Calls warp_patch for a box without augmentation.
Patch make_patch(const cv::Mat& rgb, const cv::Mat& mask, const SquareBox& box);

// Returns an 8-bit picture that is 255 where the patch is not exactly black. Official code: img_border_mask,
// which also counts black pixels inside the image as border.
cv::Mat border_mask(const cv::Mat& patch_rgb);

// Writes (3, side, side) float32, channel by channel: (min(u8 * colour, 255) - 255 mean) / (255 std) in
// float32, as the official code computes it under numpy 1.x. Throws std::invalid_argument if `planes` does
// not have 3 * side * side numbers.
void normalise_patch(const cv::Mat& patch_rgb, const std::array<double, 3>& colour_scale,
                     std::span<float> planes);

// Maps keypoints of the source image to crop units [-0.5, 0.5]: the affine map is computed in double, stored
// as float32 px, and then / 256 - 0.5 is computed in float32. Unlabelled points are mapped too, so check
// is_visible() before using a point.
smal::CropKeypoints keypoints_to_crop(const manifests::Keypoints& keypoints, const Affine& patch_from_image);

}  // namespace q3d::loaders::pictures
