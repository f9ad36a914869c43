#include "pipeline/animal/synthetic_shapes.h"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "pipeline/animal/synthetic_skeleton.h"
#include "smal/sizes.h"

namespace q3d::pipeline::animal {
namespace {

constexpr auto kFamilies = static_cast<Eigen::Index>(kNumFamilies);
constexpr auto kMeasures = static_cast<Eigen::Index>(kNumMeasures);

Eigen::VectorXd flat(const Points& points) {
  return Eigen::Map<const Eigen::VectorXd>(points.data(), points.size());
}

// Returns the change of the animal's vertices if one measure grows by one standard deviation.
Eigen::VectorXd sensitivity(const QuadrupedMesh& mesh, const Anatomy& anatomy, const Measure& measure) {
  const double spread = measure.is_angle ? measure.spread : measure.spread * std::abs(anatomy.*measure.field);
  Anatomy more = anatomy, less = anatomy;
  more.*measure.field += spread;
  less.*measure.field -= spread;
  return 0.5 * (flat(embed_quadruped(mesh, more)) - flat(embed_quadruped(mesh, less)));
}

}  // namespace

ShapeSpace make_shape_space(const QuadrupedMesh& mesh) {
  const auto size = static_cast<Eigen::Index>(3 * mesh.vertices.size());
  // A factor of the covariance of the vertices: between the families, then within each of them.
  Eigen::MatrixXd factor(size, kFamilies + kFamilies * kMeasures);
  for (Eigen::Index f = 0; f < kFamilies; ++f) {
    const Anatomy anatomy = family_anatomy(static_cast<std::size_t>(f));
    factor.col(f) = flat(embed_quadruped(mesh, anatomy));
    for (Eigen::Index m = 0; m < kMeasures; ++m) {
      factor.col(kFamilies + f * kMeasures + m) =
          sensitivity(mesh, anatomy, anatomy_measures()[static_cast<std::size_t>(m)]);
    }
  }
  const Eigen::VectorXd mean = factor.leftCols(kFamilies).rowwise().mean();
  factor.leftCols(kFamilies).colwise() -= mean;
  factor /= std::sqrt(static_cast<double>(kFamilies));

  // Eigenvectors of the small Gram matrix are the components' coordinates in the factor's columns.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(factor.transpose() * factor);
  Eigen::MatrixXd coordinates = solver.eigenvectors().rightCols(smal::kNumBetas).rowwise().reverse();
  ShapeSpace space;
  space.directions = factor * coordinates;
  for (Eigen::Index k = 0; k < smal::kNumBetas; ++k) {
    Eigen::Index largest = 0;
    space.directions.col(k).cwiseAbs().maxCoeff(&largest);
    if (space.directions(largest, k) < 0.0) {  // an eigenvector's sign is arbitrary
      space.directions.col(k) *= -1.0;
      coordinates.col(k) *= -1.0;
    }
  }
  space.mean = Eigen::Map<const Points>(mean.data(), size / 3, 3);
  coordinates *= std::sqrt(static_cast<double>(kFamilies));
  space.family_means = coordinates.topRows(kFamilies);
  for (Eigen::Index f = 0; f < kFamilies; ++f) {
    const auto at = static_cast<std::size_t>(f);
    space.family_factors[at] = coordinates.middleRows(kFamilies + f * kMeasures, kMeasures);
    space.family_covariances[at] = space.family_factors[at].transpose() * space.family_factors[at];
  }
  return space;
}

const QuadrupedMesh& synthetic_mesh() {
  static const QuadrupedMesh kMesh = make_quadruped_mesh();
  return kMesh;
}

const ShapeSpace& synthetic_shape_space() {
  static const ShapeSpace kSpace = make_shape_space(synthetic_mesh());
  return kSpace;
}

Eigen::MatrixXd pose_blend_shapes(const Points& rest, const Eigen::MatrixXd& joints,
                                  const Eigen::MatrixXd& weights) {
  Eigen::MatrixXd subtree = weights;  // a joint moves everything below it
  for (int joint = smal::kNumJoints - 1; joint > 0; --joint) {
    subtree.col(synthetic_joints()[static_cast<std::size_t>(joint)].parent) += subtree.col(joint);
  }
  Eigen::MatrixXd shapes = Eigen::MatrixXd::Zero(9 * (smal::kNumJoints - 1), rest.size());
  for (Eigen::Index joint = 1; joint < smal::kNumJoints; ++joint) {
    for (Eigen::Index v = 0; v < rest.rows(); ++v) {
      const double blend = subtree(v, joint) * (1.0 - subtree(v, joint));
      const Eigen::RowVector3d arm = rest.row(v) - joints.row(joint);
      for (Eigen::Index r = 0; r < 3; ++r) {
        for (Eigen::Index c = 0; c < 3; ++c) {
          const Eigen::Index row = 9 * (joint - 1) + 3 * r + c;
          shapes(row, 3 * v + r) -= 0.5 * blend * arm[c];
          shapes(row, 3 * v + c) -= 0.5 * blend * arm[r];
        }
      }
    }
  }
  return shapes;
}

}  // namespace q3d::pipeline::animal
