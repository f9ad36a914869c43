// The official evaluator's metrics on one sample. Paper section "Metrics"; official code:
// utils/evaluate_metric.py.
#pragma once

#include <array>
#include <optional>
#include <span>

namespace q3d::filters {

// L_proj: mean over visible keypoints (weight > 0) and both coordinates of |projected - annotated|, crop
// units. projected 26 x 2, annotated 26 x (x, y, weight). Empty when no keypoint is visible.
std::optional<double> projection_error(std::span<const float> projected, std::span<const float> annotated);

// Fraction of keypoints closer than threshold * normaliser (strict), weighted by the annotation's weight.
// normaliser_px = sqrt(mask area) of the 256-px crop, or 256 for the whole crop. Empty when no weight is > 0;
// the official evaluator counts such a sample as 0.
std::optional<double> pck(std::span<const float> projected, std::span<const float> annotated,
                          double normaliser_px, double threshold);
// Trapezoid over 100 thresholds in [0, 1] of pck.
std::optional<double> auc(std::span<const float> projected, std::span<const float> annotated,
                          double normaliser_px);

// Mean distance after the best similarity transform (scale, rotation, translation), x 1000 (mm when the unit
// is the metre). predicted and truth are N x 3. PA-MPJPE with N = 26 keypoints, PA-MPVPE with the mesh's
// vertices.
double procrustes_error_mm(std::span<const float> predicted, std::span<const float> truth);

}  // namespace q3d::filters
