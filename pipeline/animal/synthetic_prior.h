// The priors of the synthetic quadruped's poses and shapes, in the official layout, and samples from them.
#pragma once

#include <torch/types.h>

#include <random>

namespace q3d::pipeline::animal {

// Official code: PosePriorLoss. The prior loss squares (pose - mean) @ precs, of which it leaves out the
// first 3.
struct PosePrior {
  torch::Tensor mean;        // (105) float32 rad: axis-angle of 35 joints, the global orientation first
  torch::Tensor covariance;  // (105, 105)
  torch::Tensor precs;       // (105, 105): lower Cholesky factor of inverse(covariance + 1e-5 I)
};

// Official code: ShapePriorLoss. The prior loss squares (betas - means[family]) @ precs[family].
struct ShapePrior {
  torch::Tensor means;        // (5, 41) float32
  torch::Tensor covariances;  // (5, 41, 41)
  torch::Tensor precs;        // (5, 41, 41): lower Cholesky factors of inverse(covariance + 1e-5 I)
};

PosePrior synthetic_pose_prior();
ShapePrior synthetic_shape_prior();

// Returns a pose, (35, 3) float32 axis-angle in rad, within the joints' ranges: standing, walking, running,
// grazing or crouching. Row 0, the global orientation, is zero.
torch::Tensor sample_pose(std::mt19937_64& random);

// Returns betas, (41) float32, of a family from 0 to 4. Throws std::invalid_argument for any other family.
torch::Tensor sample_betas(std::int64_t family, std::mt19937_64& random);

}  // namespace q3d::pipeline::animal
