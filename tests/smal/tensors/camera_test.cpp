#include "smal/tensors/camera.h"

#include <gtest/gtest.h>

namespace q3d::smal::tensors {
namespace {

TEST(Camera, TranslationByHand) {
  const torch::Tensor camera = torch::tensor({0.5, 0.1, -0.2}, torch::kFloat64).view({1, 3});
  const torch::Tensor translation = translation_from_camera(camera);
  // 2 * 1000 / (256 * 0.5) = 15.625
  EXPECT_NEAR(translation[0][2].item<double>(), 15.625, 1e-9);
  EXPECT_EQ(translation[0][0].item<double>(), 0.1);
  EXPECT_EQ(translation[0][1].item<double>(), -0.2);
}

TEST(Camera, ProjectionToTheCropByHand) {
  const torch::Tensor points = torch::tensor({1.0, -0.5, 3.0}, torch::kFloat64).view({1, 1, 3});
  const torch::Tensor translation = torch::tensor({0.0, 0.25, 7.0}, torch::kFloat64).view({1, 3});
  const torch::Tensor projected = project_to_crop(points, translation);
  // (1 / 10) * 1000 / 256 and (-0.25 / 10) * 1000 / 256
  EXPECT_DOUBLE_EQ(projected[0][0][0].item<double>(), 0.390625);
  EXPECT_DOUBLE_EQ(projected[0][0][1].item<double>(), -0.09765625);
}

TEST(Camera, FullImageCameraSeesWhatTheCropCameraSees) {
  // A crop of side 200 px centred at (700, 150) of a 1000 x 400 picture.
  const torch::Tensor camera = torch::tensor({0.8, 0.05, -0.1}, torch::kFloat64).view({1, 3});
  const torch::Tensor center = torch::tensor({700.0, 150.0}, torch::kFloat64).view({1, 2});
  const torch::Tensor size = torch::tensor({200.0}, torch::kFloat64);
  const torch::Tensor image = torch::tensor({1000.0, 400.0}, torch::kFloat64).view({1, 2});
  const double focal_px = kFocalPx / kCropSidePx * 1000.0;
  const torch::Tensor full = camera_crop_to_full(camera, center, size, image, focal_px);
  // The model's origin: tx / (2 f / (256 s)) * f / 256 = tx s / 2 of the crop's side off its centre. The full
  // camera reaches the same pixel, from its own principal point and focal length.
  const torch::Tensor origin = torch::zeros({1, 1, 3}, torch::kFloat64);
  const torch::Tensor focal = torch::full({1, 2}, focal_px, torch::kFloat64);
  const torch::Tensor pixel = perspective_projection(origin, full, focal) + image.unsqueeze(1) / 2;
  EXPECT_NEAR(pixel[0][0][0].item<double>(), 700.0 + 200.0 * 0.05 * 0.8 / 2, 1e-6);
  EXPECT_NEAR(pixel[0][0][1].item<double>(), 150.0 - 200.0 * 0.1 * 0.8 / 2, 1e-6);
}

TEST(Camera, RefusesOtherShapes) {
  const torch::Tensor points = torch::ones({2, 26, 3});
  EXPECT_THROW(translation_from_camera(torch::ones({2, 4})), std::invalid_argument);
  EXPECT_THROW(project_to_crop(points, torch::ones({1, 3})), std::invalid_argument);
  EXPECT_THROW(perspective_projection(points, torch::ones({2, 3}), torch::ones({2, 3})),
               std::invalid_argument);
  EXPECT_THROW(project_to_crop(torch::ones({26, 3}), torch::ones({1, 3})), std::invalid_argument);
  EXPECT_THROW(camera_crop_to_full(torch::ones({2, 3}), torch::ones({2, 2}), torch::ones({2, 1}),
                                   torch::ones({2, 2}), 1.0),
               std::invalid_argument);
}

}  // namespace
}  // namespace q3d::smal::tensors
