// The official demo's crop, for pictures with a detector's box and no annotation.
#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <vector>

namespace q3d::loaders::pictures {

struct DemoCrop {
  std::vector<float> planes;  // (3, 256, 256) RGB, normalised with ImageNet's mean and std
  float center_x_px = 0.0F;
  float center_y_px = 0.0F;
  float side_px = 0.0F;
};

// Cuts and normalises the crop of a box. Official code: ViTDetDataset. The box is (x1, y1, x2, y2) in pixels.
// Its centre is not floored. Its side is the longer one after the box was widened to `aspect` (width, height;
// {0, 0} leaves it unchanged). A picture that shrinks by more than 2.2 times is blurred first (Gaussian, in
// double) and then warped without rounding to 8 bits. Throws std::invalid_argument for types other than 8-bit
// RGB and for a box without area.
DemoCrop demo_crop(const cv::Mat& rgb, const std::array<float, 4>& box_xyxy,
                   const std::array<int, 2>& aspect = {0, 0});

}  // namespace q3d::loaders::pictures
