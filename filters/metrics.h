// The official evaluator's metrics on one sample. Paper section "Metrics"; official code:
// utils/evaluate_metric.py.
#pragma once

#include <optional>
#include <span>
#include <vector>

namespace q3d::filters {

// Keypoints come as `projected` 26 x (x, y) and `annotated` 26 x (x, y, weight), crop units; a keypoint is
// visible when its weight is > 0. All functions throw std::invalid_argument when the counts do not match.

// L_proj: mean over visible keypoints and both coordinates of |projected - annotated|, crop units. Empty when
// no keypoint is visible.
std::optional<double> projection_error(std::span<const float> projected, std::span<const float> annotated);

// Fraction of keypoints closer than threshold * normaliser (strict), weighted by the annotation's weight.
// normaliser_px = sqrt(mask area) of the 256-px crop, or 256 for the whole crop; 0 (an empty mask) gives 0.
// Empty when no keypoint is visible; the official evaluator counts such a sample as 0.
std::optional<double> pck(std::span<const float> projected, std::span<const float> annotated,
                          double normaliser_px, double threshold);

// Trapezoid over 100 thresholds in [0, 1] of pck. A perfect sample gives 0.99495, because no distance is
// below the threshold 0.
std::optional<double> auc(std::span<const float> projected, std::span<const float> annotated,
                          double normaliser_px);

// `predicted` (N x 3) after the similarity transform (scale, proper rotation, translation) that brings it
// closest to `truth` (N x 3) in the least-squares sense. Official code: compute_similarity_transform.
std::vector<double> procrustes_align(std::span<const float> predicted, std::span<const float> truth);

// Mean distance after procrustes_align, x 1000 (mm when the unit is the metre); NaN when a number is not
// finite. PA-MPJPE with the 26 keypoints, PA-MPVPE with the mesh's vertices.
double procrustes_error_mm(std::span<const float> predicted, std::span<const float> truth);

}  // namespace q3d::filters
