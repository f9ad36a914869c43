// A schedule says how one sample is adapted and when its adaptation ends. The fidelity rule makes it
// (filters/fidelity.h) and the network's adaptation follows it (model/tta.h). Neither knows the other.
#pragma once

#include <array>
#include <span>

#include "smal/sizes.h"

namespace q3d::filters::adaptation {

// All fields belong to one sample, so that its result does not depend on the other samples of its batch.
struct Schedule {
  int iterations = 10;
  double stop_below = 0.0;  // crop units; adaptation ends as soon as L_proj is below it; 0 = never
  double min_gain = 0.0;    // ends after gain_window iterations if the relative gain is smaller; 0 = never
  int gain_window = 10;
  // Visible keypoints that the objective does not see. At least one visible keypoint must remain. If any are
  // held out, the best iterate is the one with the least error on them.
  std::array<bool, smal::kNumKeypoints> held_out{};
  int patience = 0;  // adaptation ends after so many iterations without a new least held-out error; 0 = never
};

// Returns whether any keypoint is held out.
bool holds_out(const Schedule& schedule);

// Throws std::invalid_argument that names the field unless iterations >= 0, gain_window >= 1 and
// patience >= 0.
void check(const Schedule& schedule);

// Returns (L0 - least of iterates 1..window) / L0, over those of these iterates that are finite. `curve`
// holds L_proj of the iterates 0..n; L0 is its first value. It is 0 for L0 = 0, and NaN if none of these
// iterates is there and finite. Throws std::invalid_argument for an empty curve.
double relative_gain(std::span<const double> curve, int window);

// Returns whether adaptation ends at the last iterate of `curve`. `best`: the best iterate so far.
bool is_finished(const Schedule& schedule, std::span<const double> curve, int best);

}  // namespace q3d::filters::adaptation
