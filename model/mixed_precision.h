// Turns on LibTorch's autocast for one scope.
#pragma once

#include <torch/types.h>

namespace q3d::model {

// While it lives, and if it is enabled, matrix products, convolutions and attention of `device`'s kind run in
// bfloat16; sums, norms and what LibTorch calls unsafe stay float32. Affects the calling thread. Backward
// passes belong outside. Casts of weights are remembered within the scope and forgotten at its end, since the
// weights then change.
class MixedPrecision {
 public:
  MixedPrecision(torch::Device device, bool enabled);
  ~MixedPrecision();
  MixedPrecision(const MixedPrecision&) = delete;
  MixedPrecision& operator=(const MixedPrecision&) = delete;

 private:
  at::DeviceType kind_;
  bool was_enabled_;
  torch::ScalarType previous_dtype_;
};

// Returns whether `device` multiplies in bfloat16 itself: GPUs and x86 processors with AVX512_BF16. On others
// LibTorch's convolutions in it are about ten times slower than in float32.
bool multiplies_in_bfloat16(torch::Device device);

// Returns whether training in bfloat16 saves time on `device`: on GPUs, on AMD's processors with AVX512_BF16,
// and on Intel's if they have AMX too (docs/performance.md).
bool bfloat16_is_fast(torch::Device device);

}  // namespace q3d::model
