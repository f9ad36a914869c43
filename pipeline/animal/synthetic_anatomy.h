// The measures of a synthetic quadruped, family by family.
#pragma once

#include <array>
#include <cstddef>

namespace q3d::pipeline::animal {

inline constexpr std::size_t kNumFamilies = 5;  // Felidae, Canidae, Equidae, Bovidae, Hippopotamidae

// Lengths, widths and depths in model units (full, not half), angles in radians. "Depth" is measured from the
// back to the belly, "width" from side to side. The template stands with its hips and shoulders at y = 0.1 or
// so, and its ground lies where its legs end.
struct Anatomy {
  // Trunk.
  double trunk_length;    // hips to shoulders
  double withers_height;  // y of the back over the shoulders
  double croup_height;    // y of the back over the hips
  double back_sag;        // how far the back's middle lies below the line between them
  double chest_depth, chest_width;
  double belly_depth, belly_width;
  double loin_depth, loin_width;
  double rump_depth, rump_width;
  double rump_length;  // hips to the rearmost point
  // Neck.
  double neck_length;
  double neck_angle;  // elevation over the horizontal
  double neck_base_depth, neck_base_width;
  double neck_top_depth, neck_top_width;
  // Head.
  double head_length;
  double head_pitch;  // how far the face points below the horizontal
  double cranium_depth, cranium_width;
  double eye_depth;     // mouth line to forehead
  double muzzle_share;  // part of the head before the eyes
  double muzzle_depth, muzzle_width;
  double nose_depth, nose_width;
  double jaw_depth;
  double ear_length, ear_width;
  double ear_spread;  // from upright towards the side
  // Tail.
  double tail_length;
  double tail_base_width, tail_tip_width;
  double tail_droop;  // how far the tail points below the horizontal
  // Front legs.
  double foreleg_length;    // elbow to ground
  double foreleg_distance;  // between the two legs' axes
  double elbow_thickness, carpus_thickness, fore_cannon_thickness;
  // Hind legs.
  double hindleg_distance;
  double thigh_thickness, stifle_thickness, hock_thickness, hind_cannon_thickness;
  double hock_height;  // over the ground
  // Feet.
  double foot_length, foot_width, foot_height;
};

inline constexpr std::size_t kNumMeasures = sizeof(Anatomy) / sizeof(double);

// One measure for all families, and its spread among the individuals of one family.
struct Measure {
  double Anatomy::*field;
  std::array<double, kNumFamilies> family_means;
  double spread;  // standard deviation: relative to the mean, or absolute in radians
  bool is_angle;
};

// Returns every field of Anatomy once, in declaration order.
const std::array<Measure, kNumMeasures>& anatomy_measures();

// Returns the mean animal of a family, which is a number from 0 to 4.
Anatomy family_anatomy(std::size_t family);

}  // namespace q3d::pipeline::animal
