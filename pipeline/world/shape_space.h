// Represents species as regions of SMAL's shape space.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "manifests/random.h"
#include "pipeline/world/bodies.h"
#include "pipeline/world/species.h"

namespace q3d::pipeline::world {

class ShapeSpace {
 public:
  // shape_directions (3 V, 41): row 3 vertex + xyz; family_means (5, 41); family_factors: one (measures, 41)
  // a family, the betas of one standard deviation of each independent measure of its animals.
  ShapeSpace(const RestMesh& rest, Eigen::MatrixXd shape_directions, Eigen::MatrixXd family_means,
             std::vector<Eigen::MatrixXd> family_factors);

  // Returns the betas of a typical animal of a species: its family's mean, changed by the likeliest measures
  // that give its build, to first order. No measure changes by more than three deviations.
  Eigen::VectorXd typical(const Species& species) const;

  // Draws an individual around the typical one, with half the family's deviations.
  std::array<float, smal::kNumBetas> draw(const Species& species, manifests::Rng& rng) const;

 private:
  struct Length {  // of a body part: the distance of two groups of vertices
    Eigen::Vector3d from, to;
    Eigen::MatrixXd from_directions, to_directions;  // (3, 41)
  };
  Length between(const RestMesh& rest, const std::vector<int>& from, const std::vector<int>& to) const;

  Eigen::MatrixXd directions_;
  Eigen::MatrixXd family_means_;
  std::vector<Eigen::MatrixXd> family_factors_;
  std::vector<Length> lengths_;  // legs, neck, girth, head, ears, tail (shape_space.cpp)
};

}  // namespace q3d::pipeline::world
