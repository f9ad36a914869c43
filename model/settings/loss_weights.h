// The weights of the losses, and the variant of the losses.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace q3d::model::settings {

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

// `official` reproduces the gradients of the released code bit for bit. They are NaN if a predicted joint is
// not rotated at all, and samples without truth count as real animals for the discriminator. `sound` avoids
// both.
enum class LossVariant : std::uint8_t { sound, official };

std::string_view to_string(LossVariant variant);
std::vector<std::string> loss_variant_names();                // in the order of the enumerators
LossVariant loss_variant_from_string(std::string_view name);  // throws std::invalid_argument

}  // namespace q3d::model::settings
