// Guards are optional rules in addition to the paper's. The paper's rule looks at 2D agreement only, which
// adaptation can reach with a wrong body. Guards check other properties as well. Each guard is off until it
// has a value.
#pragma once

#include "manifests/verdict.h"

namespace q3d::filters {

// Bounds on a label that the fidelity rule keeps. A bound of 0 turns its guard off.
struct GuardBounds {
  int visible_min = 0;              // least number of visible keypoints
  double pose_deviation_max = 0.0;  // standard deviations of the pose prior, root mean square
  double limb_factor_max = 0.0;     // beyond the families' range of relative limb lengths
  double left_right_max = 0.0;      // error as annotated, divided by the error with left and right exchanged
  double mask_iou_min = 0.0;        // intersection over union of silhouette and mask
};
// Throws std::invalid_argument that names the bound unless 0 <= visible_min <= 26, 0 <= mask_iou_min <= 1 and
// the others are finite and not negative.
void check(const GuardBounds& bounds);
bool is_any_on(const GuardBounds& bounds);

// Turns a kept judgement into a discarded one if the label breaks a bound. A score that is NaN, because there
// is nothing to measure (no mask, no pair of keypoints), breaks none. The reason is that of the first broken
// bound in the order of GuardBounds; the detail names all of them. Other judgements are returned unchanged.
manifests::Judgement apply_bounds(manifests::Judgement judgement, const manifests::TrustScores& scores,
                                  const GuardBounds& bounds);

// Returns the number of adaptation steps for a sample with `visible` keypoints: round(iterations * visible /
// full_at), with halves rounded up, and at least 1. From full_at on, or with full_at = 0, it is all of them.
// The reason is that few points are overfitted sooner. Throws std::invalid_argument for negative numbers.
int scaled_iterations(int iterations, int visible, int full_at);

}  // namespace q3d::filters
