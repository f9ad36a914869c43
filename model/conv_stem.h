// A convolutional stem in place of a ViT's patch projection: "Early Convolutions Help Transformers See
// Better" (Xiao et al. 2021). A patch projection is linear, so a ViT has to learn edges, parts and
// neighbourhood through attention, which takes millions of pictures; a few convolutions learn them from
// thousands. For networks trained from scratch: the official weights have no such stem.
#pragma once

#include <torch/nn/module.h>
#include <torch/types.h>

#include <memory>
#include <string>
#include <vector>

#include "model/efficientnet_lite.h"
#include "model/layers.h"

namespace q3d::model {

// Convolution of 3 x 3 or 7 x 7 pixels without bias, group norm, ReLU.
class ConvUnit;

class ConvStem : public torch::nn::Module {
 public:
  // `depth` is the number of convolutions at the resolution of the tokens.
  ConvStem(std::int64_t width, std::int64_t depth, const Placement& placement);

  // images (B, 3, H, W), H and W multiples of 16 -> (B, H / 16 * W / 16, width), row-major.
  torch::Tensor forward(const torch::Tensor& images) const;

 private:
  std::vector<std::shared_ptr<ConvUnit>> units_;
  std::shared_ptr<Linear> proj_;
};

// Cuts images into tokens: by the official patch projection, by a convolutional stem, or by an EfficientNet
// whose channels a matrix maps to the width. Registers its parameters with `owner`: the projection, and the
// matrix in its place, under the name `projection`, the stem under "stem", the EfficientNet under
// "efficientnet".
class Tokeniser {
 public:
  struct Patches {
    std::string projection;
    std::int64_t patch_px;
    std::int64_t padding_px;
    bool has_bias;
  };
  struct Stem {  // at most one of the two (check_config); neither: the patch projection
    std::int64_t depth = 0;
    bool efficientnet = false;
  };
  Tokeniser(torch::nn::Module& owner, const Patches& patches, std::int64_t width, const Stem& stem,
            const Placement& placement);

  torch::Tensor forward(const torch::Tensor& images) const;  // (B, 3, H, W) -> (B, tokens, width)

 private:
  std::shared_ptr<PatchConv> patches_;
  std::shared_ptr<ConvStem> stem_;
  std::shared_ptr<EfficientNetLite> efficientnet_;
  std::shared_ptr<Linear> proj_;  // of the EfficientNet's channels
};

}  // namespace q3d::model
