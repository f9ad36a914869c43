// Trust scores say how far a predicted label can be trusted, beyond its L_proj. They need no truth.
// docs/filters.md says how they are measured, docs/results.md what each is worth.
#pragma once

#include <array>
#include <limits>

namespace q3d::manifests {

// A score is NaN where it was not measured: for labels that do not come from a network, for candidates
// without a label, and where a mask or the priors are missing.
struct TrustScores {
  static constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();
  double combined = kNotMeasured;
  double mirror = kNotMeasured;
  double aux_2d = kNotMeasured;
  double aux_3d = kNotMeasured;
  double pose_prior = kNotMeasured;
  double shape_prior = kNotMeasured;
  double limbs = kNotMeasured;
  double sides = kNotMeasured;
  double mask = kNotMeasured;
  double visible = kNotMeasured;
};

// A score as shards and verdicts.csv name it.
struct TrustColumn {
  const char* name;
  double TrustScores::*score;
  const char* units;  // empty if it has none
  const char* meaning;
};

inline constexpr std::array<TrustColumn, 10> kTrustColumns{{
    {"trust", &TrustScores::combined, "",
     "how far the label can be trusted, from 0 to 1, 1 = most: the scores below combined; NaN when not "
     "measured, as for all of them"},
    {"trust_mirror", &TrustScores::mirror, "mm",
     "mean distance of the body's keypoints from those predicted for the mirrored picture, after Procrustes "
     "alignment"},
    {"trust_aux_2d", &TrustScores::aux_2d, "crop units",
     "mean absolute difference of the decoder's auxiliary 2D keypoints and the body's, over all 26 and both "
     "coordinates"},
    {"trust_aux_3d", &TrustScores::aux_3d, "mm",
     "mean distance of the decoder's auxiliary 3D keypoints from the body's, after Procrustes alignment"},
    {"trust_pose_prior", &TrustScores::pose_prior, "",
     "root mean square deviation of the pose from the pose prior, in standard deviations"},
    {"trust_shape_prior", &TrustScores::shape_prior, "",
     "root mean square deviation of betas from the family's shape prior, in standard deviations; of the "
     "nearest "
     "family where the family is none of the five"},
    {"trust_limbs", &TrustScores::limbs, "",
     "factor by which the worst leg bone, relative to the spine, lies beyond the families' range; at most 1 "
     "within it"},
    {"trust_sides", &TrustScores::sides, "",
     "error over pairs of left and right keypoints, divided by the same error with the sides exchanged"},
    {"trust_mask", &TrustScores::mask, "",
     "intersection over union of the body's silhouette and the mask, in the network's crop"},
    {"trust_visible", &TrustScores::visible, "", "number of visible keypoints"},
}};

}  // namespace q3d::manifests
