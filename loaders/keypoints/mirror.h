// Mirrors labels from left to right when a photograph is mirrored.
//
// This is not part of the official code, whose own flip crashes and is off. Left and right of the body are
// the two sides of its plane z = 0. A body whose template and shape space are symmetric about this plane has
// an exact mirror image.
#pragma once

#include <cstddef>
#include <span>

namespace q3d::loaders::keypoints {

// Exchanges the rows of left and right keypoints. rows: 26 x width, row-major. Throws std::invalid_argument
// for another size.
void swap_keypoint_sides(std::span<float> rows, std::size_t width);

// Mirrors a pose about the camera's plane x = 0. The keypoints of the new pose are those of the old one with
// x negated and sides exchanged, up to a translation, because a body turns about its root. rotations: 35 x 3
// x 3, row-major; joint 0 is the global orientation. Throws std::invalid_argument for another size.
void mirror_pose(std::span<float> rotations);

}  // namespace q3d::loaders::keypoints
