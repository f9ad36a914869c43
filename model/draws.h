// Repeats the random draws of a computation. Dropout and stochastic depth draw from LibTorch's default
// generator of a device.
#pragma once

#include <torch/types.h>

namespace q3d::model {

// Remembers where the generator of a device stands.
class Draws {
 public:
  explicit Draws(torch::Device device);

 private:
  friend class RepeatedDraws;
  torch::Device device_;
  torch::Tensor state_;
};

// For one scope, the generator draws once more what it drew after `draws`. Then it goes on where it was.
class RepeatedDraws {
 public:
  explicit RepeatedDraws(const Draws& draws);
  ~RepeatedDraws();
  RepeatedDraws(const RepeatedDraws&) = delete;
  RepeatedDraws& operator=(const RepeatedDraws&) = delete;

 private:
  Draws present_;
};

}  // namespace q3d::model
