// Checks shape and dtype of the tensors that the public functions of smal/ take.
#pragma once

#include <torch/types.h>

#include <vector>

namespace q3d::smal::tensors {

inline constexpr std::int64_t kAnySize = -1;

// Throws std::invalid_argument "where: name is (got) dtype, expected (...) floating point" unless `tensor` is
// a floating-point tensor of the given sizes, of which kAnySize matches every size.
void expect_floating(const torch::Tensor& tensor, const char* where, const char* name,
                     const std::vector<std::int64_t>& sizes);

// Checks the last sizes only: any number of leading sizes may come before `trailing`.
void expect_trailing(const torch::Tensor& tensor, const char* where, const char* name,
                     const std::vector<std::int64_t>& trailing);

}  // namespace q3d::smal::tensors
