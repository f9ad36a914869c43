#include "smal/tensors/camera.h"

#include "smal/tensors/tensor_check.h"

namespace q3d::smal::tensors {
namespace {

constexpr double kScaleGuard = 1e-9;  // as in the official code; s itself is not clamped

}  // namespace

torch::Tensor translation_from_camera(const torch::Tensor& camera, double focal_px) {
  expect_floating(camera, "translation_from_camera", "camera", {kAnySize, 3});
  const torch::Tensor depth = 2.0 * focal_px / (kCropSidePx * camera.select(1, 0) + kScaleGuard);
  return torch::stack({camera.select(1, 1), camera.select(1, 2), depth}, 1);
}

torch::Tensor perspective_projection(const torch::Tensor& points, const torch::Tensor& translation,
                                     const torch::Tensor& focal) {
  expect_floating(points, "perspective_projection", "points", {kAnySize, kAnySize, 3});
  const std::int64_t batch = points.size(0);
  expect_floating(translation, "perspective_projection", "translation", {batch, 3});
  expect_floating(focal, "perspective_projection", "focal", {batch, 2});
  const torch::Tensor moved = points + translation.unsqueeze(1);
  return moved.narrow(2, 0, 2) / moved.narrow(2, 2, 1) * focal.unsqueeze(1);
}

torch::Tensor project_to_crop(const torch::Tensor& points, const torch::Tensor& translation,
                              double focal_px) {
  expect_floating(points, "project_to_crop", "points", {kAnySize, kAnySize, 3});
  const torch::Tensor focal = torch::full({points.size(0), 2}, focal_px / kCropSidePx, points.options());
  return perspective_projection(points, translation, focal);
}

torch::Tensor camera_crop_to_full(const torch::Tensor& camera, const torch::Tensor& box_center,
                                  const torch::Tensor& box_size, const torch::Tensor& image_size,
                                  double focal_px) {
  expect_floating(camera, "camera_crop_to_full", "camera", {kAnySize, 3});
  const std::int64_t batch = camera.size(0);
  expect_floating(box_center, "camera_crop_to_full", "box_center", {batch, 2});
  expect_floating(box_size, "camera_crop_to_full", "box_size", {batch});
  expect_floating(image_size, "camera_crop_to_full", "image_size", {batch, 2});
  const torch::Tensor scaled_box = (box_size * camera.select(1, 0) + kScaleGuard).unsqueeze(1);
  const torch::Tensor shift = 2.0 * (box_center - image_size / 2.0) / scaled_box;
  return torch::cat({camera.narrow(1, 1, 2) + shift, 2.0 * focal_px / scaled_box}, 1);
}

}  // namespace q3d::smal::tensors
