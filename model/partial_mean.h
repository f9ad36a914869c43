// A mean whose sum and count are kept apart, so that those of several ranks can be added before they are
// divided.
#pragma once

#include <torch/torch.h>

namespace q3d::model {

struct PartialMean {
  torch::Tensor sum;    // scalar, with its graph
  torch::Tensor count;  // scalar: the number of entries in the sum

  // 0 when nothing was counted.
  torch::Tensor value() const { return sum / count.clamp_min(1.0); }
};

}  // namespace q3d::model
