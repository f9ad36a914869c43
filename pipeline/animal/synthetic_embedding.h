// Places the vertices of the synthetic quadruped for an animal of given measures.
#pragma once

#include <Eigen/Core>

#include "pipeline/animal/synthetic_anatomy.h"
#include "pipeline/animal/synthetic_mesh.h"

namespace q3d::pipeline::animal {

using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

// Returns the vertices, (V, 3) in model units: x points to the head, y up, z to the right. The animal is
// exactly symmetric about z = 0.
Points embed_quadruped(const QuadrupedMesh& mesh, const Anatomy& anatomy);

}  // namespace q3d::pipeline::animal
