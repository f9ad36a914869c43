// The crop camera and the full-image camera.
#pragma once

#include <torch/types.h>

#include "smal/camera.h"

namespace q3d::smal::tensors {

// Returns the translation (B, 3) = (tx, ty, 2 f / (256 s + 1e-9)) of a camera (B, 3) = (s, tx, ty). Official
// code: PRIMA.forward_step.
torch::Tensor translation_from_camera(const torch::Tensor& camera, double focal_px = kFocalPx);

// Projects points (B, N, 3), moved by translation (B, 3), to (B, N, 2). focal (B, 2) is in the units of the
// result, whose origin is the principal point. With focal f / 256 the result is in crop units [-0.5, 0.5].
// Official code: geometry.perspective_projection.
torch::Tensor perspective_projection(const torch::Tensor& points, const torch::Tensor& translation,
                                     const torch::Tensor& focal);
// Projects points with one focal length in crop units, which is kFocalPx / kCropSidePx unless given.
torch::Tensor project_to_crop(const torch::Tensor& points, const torch::Tensor& translation,
                              double focal_px = kFocalPx);

// Converts the crop's camera to that of the whole image. camera (B, 3), box_center (B, 2) px, box_size (B)
// px, image_size (B, 2) = (W, H) px, focal of the full image in px. Official code: renderer.cam_crop_to_full.
torch::Tensor camera_crop_to_full(const torch::Tensor& camera, const torch::Tensor& box_center,
                                  const torch::Tensor& box_size, const torch::Tensor& image_size,
                                  double focal_px);

}  // namespace q3d::smal::tensors
