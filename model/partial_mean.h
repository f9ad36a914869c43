// A mean whose sum and count are kept apart, so that those of several ranks can be added before they are
// divided.
#pragma once

#include <torch/types.h>

#include <vector>

#include "model/ranks/collective.h"

namespace q3d::model {

struct PartialMean {
  torch::Tensor sum;    // scalar, with its graph
  torch::Tensor count;  // scalar: the number of entries in the sum

  // 0 when nothing was counted.
  torch::Tensor value() const { return sum / count.clamp_min(1.0); }
};

// Makes each count that of all ranks and scales the sums by their number, so that the mean over the ranks of
// value() is the joint batch's. The counts must share dtype and device.
void join_means(const std::vector<PartialMean*>& means, const ranks::Collective& ranks);

}  // namespace q3d::model
