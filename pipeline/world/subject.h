// One animal in front of the camera: its individual, its pose and its orientation.
#pragma once

#include "pipeline/world/bodies.h"
#include "pipeline/world/domain.h"
#include "pipeline/world/shape_space.h"

namespace q3d::pipeline::world {

struct Subject {
  Posture posture;  // with the global orientation
  Coat coat;
  Eigen::Vector3f individual{0.0F, 0.0F, 0.0F};  // shifts the coat's pattern
  Eigen::Vector3f up{0.0F, -1.0F, 0.0F};         // the world's upward direction in the camera's frame
  double lift = 0.0;                             // height of the feet over the ground, SMAL units
  Place place = Place::meadow;
};

// `who` is the random source of individual, coat and place, and `when` that of pose and view. Frames of one
// film share `who`.
Subject draw_subject(const Species& species, const Domain& domain, const ShapeSpace& shapes,
                     manifests::Rng& who, manifests::Rng& when);

}  // namespace q3d::pipeline::world
