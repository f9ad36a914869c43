// How the losses are weighed, and which form of them is used. Free of LibTorch, for whoever reads
// configurations.
#pragma once

namespace q3d::model {

// The official configuration.
struct LossWeights {
  double keypoints_3d = 0.05;
  double keypoints_2d = 0.01;
  double aux_keypoints_2d = 0.001;
  double aux_keypoints_3d = 0.001;
  double global_orient = 0.005;
  double pose = 0.001;
  double betas = 0.0005;
  double contrastive = 0.0005;
  double adversarial = 0.0005;  // used in the warm-up only

  bool operator==(const LossWeights&) const = default;
};

// `official` repeats the released code to the bit of its gradients, which are NaN where a predicted joint is
// not rotated at all, and lets samples without truth pose as real animals for the discriminator. `sound` has
// neither.
enum class LossVariant { sound, official };

}  // namespace q3d::model
