// Places the vertices of the synthetic quadruped for an animal of given measures.
#pragma once

#include <Eigen/Core>

#include "pipeline/animal/synthetic_anatomy.h"
#include "pipeline/animal/synthetic_mesh.h"

namespace q3d::pipeline::animal {

using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

// (V, 3) model units, x to the head, y up, z to the right; an exact mirror image of itself in z = 0.
Points embed_quadruped(const QuadrupedMesh& mesh, const Anatomy& anatomy);

}  // namespace q3d::pipeline::animal
