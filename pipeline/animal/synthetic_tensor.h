// Converts matrices of Eigen to tensors.
#pragma once

#include <torch/types.h>

#include <Eigen/Core>
#include <vector>

namespace q3d::pipeline::animal {

// Returns a float32 copy, row-major, in the given shape.
inline torch::Tensor to_tensor(
    const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>& matrix,
    const std::vector<std::int64_t>& shape) {
  return torch::from_blob(const_cast<double*>(matrix.data()), shape, torch::kFloat64).to(torch::kFloat32);
}

}  // namespace q3d::pipeline::animal
