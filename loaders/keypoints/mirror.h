// Mirror images of labels, left for right: what a photograph that is turned over shows.
//
// No part of the official code, whose own flip crashes and is off. The body's own left and right are the two
// sides of its plane z = 0; a body whose template and shape space are symmetric about it has an exact mirror
// image.
#pragma once

#include <cstddef>
#include <span>

namespace q3d::loaders::keypoints {

// Exchanges the rows of left and right keypoints. rows: 26 x width, row-major. Throws std::invalid_argument
// on another size.
void swap_keypoint_sides(std::span<float> rows, std::size_t width);

// The pose of the mirrored body, mirrored about the camera's plane x = 0, so that its keypoints are those of
// the pose given with x negated and sides exchanged, up to a translation, since a body turns about its root.
// rotations: 35 x 3 x 3, row-major, joint 0 is the global orientation. Throws std::invalid_argument on
// another size.
void mirror_pose(std::span<float> rotations);

}  // namespace q3d::loaders::keypoints
