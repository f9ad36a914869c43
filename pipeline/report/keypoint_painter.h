// Draws keypoints over pictures: the annotated ones with the bones between them, and those of a body.
#pragma once

#include <opencv2/core.hpp>

#include <array>
#include <span>

#include "smal/keypoints.h"

namespace q3d::pipeline::report {

enum class Side { left, right, middle };  // of the animal

struct Bone {
  int from = 0;
  int to = 0;
  Side side = Side::middle;
};

// Returns the lines that are drawn between the 26 keypoints of Animal3D.
std::span<const Bone> bones();

// Returns blue for the left, orange for the right, and white for the middle.
const cv::Scalar& colour_of(Side side);

// Returns the position of a point of the network's crop in a square tile that shows `context` times the crop.
// x and y are in crop units.
cv::Point2d to_tile(double x, double y, int tile_side_px, double context);

// Draws the visible annotated keypoints as discs, with their bones. `projected` may be null; else each of its
// 26 points is a cross, a yellow line leads from each visible annotated keypoint to its cross, and the
// `named` largest errors carry their keypoint's name and error in % of the crop's side.
void draw_keypoints(cv::Mat& tile, const smal::CropKeypoints& annotated, const smal::CropPoints* projected,
                    double context, int named);

}  // namespace q3d::pipeline::report
