// Trains on a batch of which the device can hold a part at a time: gradient accumulation that also suits
// losses which compare the samples of a batch with each other (Gao et al. 2021, "Scaling deep contrastive
// learning batch size under memory limited setup"). Official code: none.
#pragma once

#include <torch/types.h>

#include <functional>
#include <vector>

#include "model/draws.h"
#include "model/ranks/collective.h"

namespace q3d::model {

// From images (B, 3, 256, 256) to any number of tensors (B, ...), each sample by itself.
using NetworkPass = std::function<std::vector<torch::Tensor>(const torch::Tensor& images)>;

class BatchInParts {
 public:
  // Computes the outputs of all images: those of `parts` groups of them, one group after the other. Throws
  // std::invalid_argument if `parts` is not at least 1 and at most the number of images.
  BatchInParts(NetworkPass pass, const torch::Tensor& images, int parts);

  // Each is (B, ...). With several parts the outputs are leaves of the graph, which holds no activation.
  const std::vector<torch::Tensor>& outputs() const { return outputs_; }

  // Adds the gradients of `loss`, a scalar that depends on the network through the outputs alone, to its
  // parameters. With several parts, each is computed once more, with the same draws. Call it once.
  void backward(const torch::Tensor& loss, ranks::AveragedBackward& averaged);

 private:
  struct Part {
    torch::Tensor images;
    Draws draws;  // before its pass
  };

  // Returns a scalar whose gradients are those that the loss has through the samples of the part, which begin
  // at `first`.
  torch::Tensor with_gradients_of(const Part& part, std::int64_t first) const;

  NetworkPass pass_;
  std::vector<Part> parts_;  // none if the batch is computed as a whole
  std::vector<torch::Tensor> outputs_;
};

}  // namespace q3d::model
