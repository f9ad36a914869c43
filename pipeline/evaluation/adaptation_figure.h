// Draws the curves of the paper's study of adaptation: quality over iterations, and over the share of visible
// keypoints.
#pragma once

#include <string>

#include "pipeline/evaluation/tables.h"

namespace q3d::pipeline::evaluation {

// Returns an SVG with AUC and PA-MPJPE side by side, one line for each dataset. The first row of panels has
// the settings "iterate N" over N. The second row has the settings "TTA N with S % of the keypoints" over S.
// A row without two points is left out. Returns "" if no row is left.
std::string adaptation_figure(const Tables& tables);

}  // namespace q3d::pipeline::evaluation
