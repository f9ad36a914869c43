// The crop camera and the full-image camera.
#pragma once

#include <torch/types.h>

#include "smal/camera.h"

namespace q3d::smal::tensors {

// camera (B, 3) = (s, tx, ty) -> translation (B, 3) = (tx, ty, 2 f / (256 s + 1e-9)). Official:
// PRIMA.forward_step.
torch::Tensor translation_from_camera(const torch::Tensor& camera, double focal_px = kFocalPx);

// points (B, N, 3), translation (B, 3), focal (B, 2) in the units of the result -> (B, N, 2); principal point
// 0. With focal f / 256 the result is in crop units [-0.5, 0.5]. Official code:
// geometry.perspective_projection.
torch::Tensor perspective_projection(const torch::Tensor& points, const torch::Tensor& translation,
                                     const torch::Tensor& focal);
// The same with one focal length in crop units, kFocalPx / kCropSidePx unless given.
torch::Tensor project_to_crop(const torch::Tensor& points, const torch::Tensor& translation,
                              double focal_px = kFocalPx);

// Camera of the whole image from that of the crop. camera (B, 3), box_center (B, 2) px, box_size (B) px,
// image_size (B, 2) = (W, H) px, focal of the full image in px. Official code: renderer.cam_crop_to_full.
torch::Tensor camera_crop_to_full(const torch::Tensor& camera, const torch::Tensor& box_center,
                                  const torch::Tensor& box_size, const torch::Tensor& image_size,
                                  double focal_px);

}  // namespace q3d::smal::tensors
