// Draws what the animal is doing, from standing to the rare extremes.
#pragma once

#include <array>

#include "manifests/random.h"
#include "pipeline/world/bodies.h"

namespace q3d::pipeline::world {

struct Stance {
  std::array<float, 3 * smal::kNumJoints> pose{};  // axis-angle, rad; the first three stay zero
  double pitch = 0.0;                              // pitch of the whole body, rad: nose up
  double roll = 0.0;                               // rad: the back turns towards the animal's right
  double lift = 0.0;                               // height of the lowest point over the ground, SMAL units
};

struct StanceHabits {
  double extreme = 0.04;  // share of rearing, leaping, rolling, stretching animals
  double resting = 0.12;  // share of sitting and lying ones
  double spread = 1.0;    // scales the other poses' distance from the mean pose
};

// Most animals stand, walk, run, graze or crouch. Their poses come from the synthetic pose prior, within the
// ranges of the joints. Resting and extreme animals have special postures, which are unlikely under the
// prior.
Stance draw_stance(const StanceHabits& habits, manifests::Rng& rng);

}  // namespace q3d::pipeline::world
