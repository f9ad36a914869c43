#include "pipeline/animal/synthetic_files.h"

#include "pipeline/animal/synthetic_prior.h"
#include "pipeline/animal/synthetic_quadruped.h"

namespace q3d::pipeline::animal {

void write_synthetic_asset(const std::filesystem::path& path) {
  smal::tensors::save_asset(path, make_synthetic_quadruped());
}

model::Priors synthetic_priors() {
  const PosePrior pose = synthetic_pose_prior();
  const ShapePrior shape = synthetic_shape_prior();
  torch::Tensor use_index = torch::ones({pose.mean.numel()});
  use_index.narrow(0, 0, 3).zero_();  // the global orientation has no prior
  return {pose.mean, pose.precs, use_index, shape.means, shape.precs};
}

void write_synthetic_priors(const std::filesystem::path& path) {
  model::save_priors(path, synthetic_priors());
}

}  // namespace q3d::pipeline::animal
