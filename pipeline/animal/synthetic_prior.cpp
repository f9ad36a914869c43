#include "pipeline/animal/synthetic_prior.h"

#include <Eigen/Cholesky>
#include <stdexcept>
#include <string>

#include "pipeline/animal/synthetic_motion.h"
#include "pipeline/animal/synthetic_shapes.h"
#include "pipeline/animal/synthetic_tensor.h"

namespace q3d::pipeline::animal {
namespace {

// This keeps a covariance of few motions or measures invertible. The value is the official code's for shapes.
constexpr double kRidge = 1e-5;

Eigen::MatrixXd precision_factor(const Eigen::MatrixXd& covariance) {
  const Eigen::Index size = covariance.rows();
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(size, size);
  const Eigen::MatrixXd inverse = (covariance + kRidge * identity).llt().solve(identity);
  return inverse.llt().matrixL();
}

}  // namespace

PosePrior synthetic_pose_prior() {
  const MotionModel model = synthetic_motion();
  Eigen::MatrixXd covariance = model.loadings * model.loadings.transpose();
  covariance.diagonal() += model.spread.cwiseAbs2();
  covariance.topLeftCorner<3, 3>()
      .setIdentity();  // the global orientation may be anything: the losses leave it out
  return {to_tensor(model.mean, {kPoseSize}), to_tensor(covariance, {kPoseSize, kPoseSize}),
          to_tensor(precision_factor(covariance), {kPoseSize, kPoseSize})};
}

ShapePrior synthetic_shape_prior() {
  const ShapeSpace& space = synthetic_shape_space();
  ShapePrior prior;
  prior.means = to_tensor(space.family_means, {static_cast<std::int64_t>(kNumFamilies), smal::kNumBetas});
  std::vector<torch::Tensor> covariances, precs;
  for (const Eigen::MatrixXd& covariance : space.family_covariances) {
    covariances.push_back(to_tensor(covariance, {smal::kNumBetas, smal::kNumBetas}));
    precs.push_back(to_tensor(precision_factor(covariance), {smal::kNumBetas, smal::kNumBetas}));
  }
  prior.covariances = torch::stack(covariances);
  prior.precs = torch::stack(precs);
  return prior;
}

torch::Tensor sample_pose(std::mt19937_64& random) {
  return to_tensor(sample_motion(synthetic_motion(), random), {smal::kNumJoints, 3});
}

torch::Tensor sample_betas(std::int64_t family, std::mt19937_64& random) {
  if (family < 0 || family >= static_cast<std::int64_t>(kNumFamilies)) {
    throw std::invalid_argument("sample_betas: family " + std::to_string(family) + ", expected 0 to 4");
  }
  const ShapeSpace& space = synthetic_shape_space();
  const Eigen::MatrixXd& factor = space.family_factors[static_cast<std::size_t>(family)];
  const Eigen::VectorXd measures = bounded_normals(factor.rows(), random);
  return to_tensor(space.family_means.row(family).transpose() + factor.transpose() * measures,
                   {smal::kNumBetas});
}

}  // namespace q3d::pipeline::animal
