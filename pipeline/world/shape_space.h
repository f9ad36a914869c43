// Species as regions of SMAL's shape space.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "pipeline/world/bodies.h"
#include "pipeline/world/random.h"
#include "pipeline/world/species.h"

namespace q3d::pipeline::world {

class ShapeSpace {
 public:
  // shape_directions (3 V, 41): row 3 vertex + xyz; family_means (5, 41); deviations (41) inside a family.
  ShapeSpace(const RestMesh& rest, Eigen::MatrixXf shape_directions, Eigen::MatrixXf family_means,
             Eigen::VectorXf deviations);

  // The middle of a species: its family's mean and the smallest change of betas (counted in deviations) that
  // gives its build, to first order. Betas stay within three deviations.
  Eigen::VectorXf typical(const Species& species) const;

  // An individual: about the typical one, at half the family's deviations.
  std::array<float, kBodyBetas> draw(const Species& species, Rng& rng) const;

 private:
  struct Length {  // of a body part: the distance of two groups of vertices
    Eigen::Vector3f from, to;
    Eigen::MatrixXf from_directions, to_directions;  // (3, 41)
  };
  Length between(const RestMesh& rest, const std::vector<int>& from, const std::vector<int>& to) const;

  Eigen::MatrixXf directions_;
  Eigen::MatrixXf family_means_;
  Eigen::VectorXf deviations_;
  std::vector<Length> lengths_;  // legs, neck, girth, head, ears, tail (shape_space.cpp)
};

}  // namespace q3d::pipeline::world
