// The official evaluator's metrics on one sample. Paper section "Metrics"; official code:
// utils/evaluate_metric.py.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "smal/keypoints.h"

namespace q3d::filters {

// Returns L_proj: the mean over visible keypoints and both coordinates of |projected - annotated|, in crop
// units. Empty if no keypoint is visible.
std::optional<double> projection_error(const smal::CropPoints& projected,
                                       const smal::CropKeypoints& annotated);

// Returns the fraction of keypoints that are closer than threshold * normaliser (strictly), weighted by the
// annotation's weight. normaliser_px is sqrt(mask area) of the 256-px crop, or 256 for the whole crop; 0 (an
// empty mask) gives 0. Empty if no keypoint is visible; the official evaluator counts such a sample as 0.
std::optional<double> pck(const smal::CropPoints& projected, const smal::CropKeypoints& annotated,
                          double normaliser_px, double threshold);

// Returns the area under pck over 100 thresholds in [0, 1], by the trapezoid rule. A perfect sample gives
// 0.99495, because no distance is below the threshold 0.
std::optional<double> auc(const smal::CropPoints& projected, const smal::CropKeypoints& annotated,
                          double normaliser_px);

// Points in 3D are given as numbers, N x (x, y, z). The functions below throw std::invalid_argument if the
// counts do not match.

// Returns `predicted` (N x 3) after the similarity transform (scale, proper rotation, translation) that
// brings it closest to `truth` (N x 3) in the least-squares sense. Official code:
// compute_similarity_transform.
std::vector<double> procrustes_align(std::span<const float> predicted, std::span<const float> truth);

// Returns the mean distance after procrustes_align, times 1000 (mm if the unit is the metre). NaN if a number
// is not finite. With the 26 keypoints it is PA-MPJPE, with the vertices of the mesh PA-MPVPE.
double procrustes_error_mm(std::span<const float> predicted, std::span<const float> truth);

}  // namespace q3d::filters
