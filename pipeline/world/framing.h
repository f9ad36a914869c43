// Framing places the animal in the picture, draws the annotator's box around it, and derives the camera from
// the box.
//
// The network's crop camera has focal 1000 px for a crop scaled to 256 px and its principal point in the
// crop's centre. A picture is therefore rendered with this camera, expressed in its own pixels: focal 1000
// * side / 256 px, principal point in the (floored) centre of the annotated box. It is like a part of a
// larger sensor's picture, and the translation is exact.
#pragma once

#include <opencv2/core.hpp>
#include <span>

#include "manifests/random.h"
#include "pipeline/world/scene.h"

namespace q3d::pipeline::world {

// The habits of one dataset in framing its animals.
struct FramingHabits {
  double fill_low = 0.5, fill_high = 0.9;  // longer side of the animal, share of the picture's shorter side
  double truncated = 0.1;                  // share of pictures in which the animal runs out of the picture
  double box_bias = 1.02, box_spread = 0.02;  // box side over silhouette side: mean and deviation
};

struct Framing {
  cv::Rect box;  // pixels, as a person draws it: not always tight, never outside the picture
  PictureCamera camera;
  Eigen::Vector3f translation{0.0F, 0.0F, 0.0F};
};

// Returns the camera that belongs to a box (see the note above). Throws std::invalid_argument on an empty
// box.
PictureCamera camera_of_box(const cv::Rect& box);

// Returns the translation with which the bounding box of the projected vertices has its centre at `centre_px`
// and its longer side equal to `side_px`.
Eigen::Vector3f fit_translation(std::span<const Eigen::Vector3f> vertices, const PictureCamera& camera,
                                const cv::Point2d& centre_px, double side_px);

Framing frame_animal(std::span<const Eigen::Vector3f> vertices, cv::Size picture_px,
                     const FramingHabits& habits, manifests::Rng& rng);

}  // namespace q3d::pipeline::world
