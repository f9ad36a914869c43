// Guards: opt-in rules beside the paper's. The paper's rule looks at 2D agreement alone, which adaptation can
// reach with a wrong body; a guard asks for something else as well. Each is off until it has a value.
#pragma once

#include <limits>

#include "manifests/verdict.h"

namespace q3d::filters {

// Bounds on a label that the fidelity rule keeps; 0 = the guard is off.
struct GuardBounds {
  int visible_min = 0;              // visible keypoints
  double pose_deviation_max = 0.0;  // standard deviations of the pose prior, root mean square
  double limb_factor_max = 0.0;     // beyond the families' range of relative limb lengths
  double left_right_max = 0.0;      // error as annotated over error with left and right exchanged
  double mask_iou_min = 0.0;        // intersection over union of silhouette and mask
};
// Throws std::invalid_argument naming the bound unless 0 <= visible_min <= 26, 0 <= mask_iou_min <= 1 and the
// others are finite and not negative.
void check(const GuardBounds& bounds);
bool is_any_on(const GuardBounds& bounds);

// What the bounds look at; filters/guard_measures.h defines each number. NaN where there is nothing to
// measure (no mask, no pair of keypoints): that guard then has no say.
struct LabelMeasures {
  int visible = 0;
  double pose_deviation = std::numeric_limits<double>::quiet_NaN();
  double limb_factor = std::numeric_limits<double>::quiet_NaN();
  double left_right = std::numeric_limits<double>::quiet_NaN();
  double mask_iou = std::numeric_limits<double>::quiet_NaN();
};

// A kept judgement becomes a discarded one when the label breaks a bound. The reason is that of the first
// broken bound in the order of GuardBounds, the detail names all. Other judgements come back as they are.
manifests::Judgement apply_bounds(manifests::Judgement judgement, const LabelMeasures& measures,
                                  const GuardBounds& bounds);

// Adaptation steps for a sample of `visible` keypoints: round(iterations * visible / full_at), halves up, at
// least 1; from full_at on, or with full_at = 0, all of them. Few points are overfitted sooner. Throws
// std::invalid_argument on negative numbers.
int scaled_iterations(int iterations, int visible, int full_at);

}  // namespace q3d::filters
