// Blend shapes of the synthetic quadruped.
#pragma once

#include <Eigen/Core>
#include <array>

#include "pipeline/animal/synthetic_anatomy.h"
#include "pipeline/animal/synthetic_embedding.h"
#include "pipeline/animal/synthetic_mesh.h"

namespace q3d::pipeline::animal {

// The principal components of five families of animals whose measures vary independently. Each beta has mean
// 0 and variance 1 over all families together.
struct ShapeSpace {
  Points mean;                   // (V, 3)
  Eigen::MatrixXd directions;    // (3 V, 41), by decreasing size
  Eigen::MatrixXd family_means;  // (5, 41)
  std::array<Eigen::MatrixXd, kNumFamilies>
      family_factors;  // (measures, 41): betas of one deviation of each measure
  std::array<Eigen::MatrixXd, kNumFamilies> family_covariances;  // (41, 41): factor' factor
};

ShapeSpace make_shape_space(const QuadrupedMesh& mesh);

// These return the mesh and its shape space. They are computed on the first call, from some 500 animals, and
// shared afterwards.
const QuadrupedMesh& synthetic_mesh();
const ShapeSpace& synthetic_shape_space();

// Returns the pose blend shapes, (306, 3 V). Row 9 (joint - 1) + 3 r + c multiplies entry (r, c) of the
// joint's rotation minus the identity. Linear blend skinning by weights w and 1 - w pulls a vertex at r from
// the joint towards it by w (1 - w) (1 - cos angle) r, to second order, as far as r is square to the axis.
// For any axis, (1 - cos angle) times that part of r is minus the symmetric part of (R - I) times r, which is
// linear in R.
Eigen::MatrixXd pose_blend_shapes(const Points& rest, const Eigen::MatrixXd& joints,
                                  const Eigen::MatrixXd& weights);

}  // namespace q3d::pipeline::animal
