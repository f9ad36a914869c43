#include "pipeline/animal/synthetic_anatomy.h"

namespace q3d::pipeline::animal {

// The numbers were chosen by eye from side views of house cats and lions, dogs and wolves, horses, cows and
// hippos. All are drawn to one scale, at which the trunks are about equally long.
const std::array<Measure, kNumMeasures>& anatomy_measures() {
  using A = Anatomy;
  static constexpr std::array<Measure, kNumMeasures> kMeasures = {{
      {&A::trunk_length, {0.7, 0.66, 0.74, 0.8, 0.84}, 0.05, false},
      {&A::withers_height, {0.25, 0.27, 0.31, 0.33, 0.29}, 0.04, false},
      {&A::croup_height, {0.25, 0.25, 0.30, 0.32, 0.27}, 0.05, false},
      {&A::back_sag, {0.020, 0.010, 0.030, 0.010, -0.020}, 0.50, false},
      {&A::chest_depth, {0.31, 0.34, 0.4, 0.45, 0.5}, 0.06, false},
      {&A::chest_width, {0.25, 0.23, 0.28, 0.36, 0.48}, 0.08, false},
      {&A::belly_depth, {0.3, 0.27, 0.4, 0.49, 0.56}, 0.08, false},
      {&A::belly_width, {0.26, 0.22, 0.33, 0.45, 0.58}, 0.10, false},
      {&A::loin_depth, {0.25, 0.2, 0.33, 0.42, 0.52}, 0.08, false},
      {&A::loin_width, {0.22, 0.18, 0.29, 0.37, 0.52}, 0.09, false},
      {&A::rump_depth, {0.26, 0.24, 0.34, 0.38, 0.44}, 0.06, false},
      {&A::rump_width, {0.24, 0.21, 0.30, 0.34, 0.44}, 0.07, false},
      {&A::rump_length, {0.14, 0.12, 0.17, 0.17, 0.16}, 0.06, false},
      {&A::neck_length, {0.15, 0.2, 0.42, 0.25, 0.15}, 0.08, false},
      {&A::neck_angle, {0.45, 0.7, 0.8, 0.25, 0.05}, 0.10, true},
      {&A::neck_base_depth, {0.24, 0.24, 0.33, 0.35, 0.42}, 0.07, false},
      {&A::neck_base_width, {0.2, 0.17, 0.18, 0.25, 0.38}, 0.08, false},
      {&A::neck_top_depth, {0.19, 0.16, 0.2, 0.24, 0.36}, 0.07, false},
      {&A::neck_top_width, {0.17, 0.14, 0.12, 0.17, 0.32}, 0.08, false},
      {&A::head_length, {0.29, 0.34, 0.46, 0.39, 0.5}, 0.06, false},
      {&A::head_pitch, {0.25, 0.25, 0.80, 0.50, 0.15}, 0.08, true},
      {&A::cranium_depth, {0.23, 0.18, 0.2, 0.22, 0.31}, 0.06, false},
      {&A::cranium_width, {0.22, 0.165, 0.15, 0.19, 0.3}, 0.06, false},
      {&A::eye_depth, {0.17, 0.125, 0.16, 0.165, 0.2}, 0.07, false},
      {&A::muzzle_share, {0.36, 0.52, 0.62, 0.56, 0.62}, 0.05, false},
      {&A::muzzle_depth, {0.1, 0.072, 0.115, 0.12, 0.155}, 0.08, false},
      {&A::muzzle_width, {0.125, 0.09, 0.105, 0.14, 0.28}, 0.08, false},
      {&A::nose_depth, {0.075, 0.058, 0.09, 0.105, 0.18}, 0.08, false},
      {&A::nose_width, {0.095, 0.068, 0.1, 0.14, 0.33}, 0.08, false},
      {&A::jaw_depth, {0.045, 0.035, 0.045, 0.045, 0.09}, 0.10, false},
      {&A::ear_length, {0.090, 0.120, 0.140, 0.150, 0.060}, 0.15, false},
      {&A::ear_width, {0.090, 0.075, 0.055, 0.085, 0.050}, 0.12, false},
      {&A::ear_spread, {0.50, 0.35, 0.20, 1.20, 0.55}, 0.15, true},
      {&A::tail_length, {0.68, 0.45, 0.55, 0.62, 0.20}, 0.12, false},
      {&A::tail_base_width, {0.055, 0.06, 0.075, 0.06, 0.07}, 0.12, false},
      {&A::tail_tip_width, {0.035, 0.035, 0.080, 0.045, 0.025}, 0.15, false},
      {&A::tail_droop, {0.25, 0.20, 0.75, 0.90, 0.70}, 0.12, true},
      {&A::foreleg_length, {0.4, 0.44, 0.58, 0.46, 0.31}, 0.07, false},
      {&A::foreleg_distance, {0.18, 0.16, 0.20, 0.24, 0.33}, 0.06, false},
      {&A::elbow_thickness, {0.135, 0.115, 0.14, 0.155, 0.2}, 0.08, false},
      {&A::carpus_thickness, {0.08, 0.06, 0.07, 0.085, 0.14}, 0.08, false},
      {&A::fore_cannon_thickness, {0.068, 0.048, 0.048, 0.062, 0.13}, 0.08, false},
      {&A::hindleg_distance, {0.18, 0.16, 0.20, 0.24, 0.32}, 0.06, false},
      {&A::thigh_thickness, {0.23, 0.2, 0.26, 0.27, 0.3}, 0.07, false},
      {&A::stifle_thickness, {0.155, 0.13, 0.17, 0.175, 0.22}, 0.08, false},
      {&A::hock_thickness, {0.075, 0.062, 0.08, 0.09, 0.145}, 0.08, false},
      {&A::hind_cannon_thickness, {0.064, 0.046, 0.05, 0.063, 0.13}, 0.08, false},
      {&A::hock_height, {0.17, 0.19, 0.25, 0.22, 0.14}, 0.07, false},
      {&A::foot_length, {0.12, 0.1, 0.095, 0.1, 0.15}, 0.08, false},
      {&A::foot_width, {0.09, 0.07, 0.08, 0.09, 0.16}, 0.08, false},
      {&A::foot_height, {0.052, 0.045, 0.065, 0.06, 0.07}, 0.08, false},
  }};
  return kMeasures;
}

Anatomy family_anatomy(std::size_t family) {
  Anatomy anatomy{};
  for (const Measure& measure : anatomy_measures()) anatomy.*measure.field = measure.family_means.at(family);
  return anatomy;
}

}  // namespace q3d::pipeline::animal
