// Connects a rank with the others. Ranks are processes that each train on a part of the same batch.
//
// With W ranks, every rank computes a loss and named numbers of its own part. They are made such that their
// mean over the ranks is that of the joint batch. Gradients and numbers are then averaged, so that all ranks
// move their weights alike and need never exchange them.
#pragma once

#include <torch/types.h>

#include <memory>
#include <string>
#include <vector>

namespace q3d::model::ranks {

// Runs backward passes after which every parameter holds the mean of all ranks' gradients.
class AveragedBackward {
 public:
  AveragedBackward() = default;
  AveragedBackward(const AveragedBackward&) = delete;
  AveragedBackward& operator=(const AveragedBackward&) = delete;
  virtual ~AveragedBackward() = default;

  // Every rank must call it equally often. `loss` is a scalar with its graph. A parameter that no rank's loss
  // depends on keeps an undefined gradient.
  virtual void run(const torch::Tensor& loss) = 0;
};

// All ranks must call the same functions in the same order, with tensors of the same shapes and dtypes. When
// another rank is gone or does not answer in time they throw std::runtime_error that says so.
class Collective {
 public:
  Collective() = default;
  Collective(const Collective&) = delete;
  Collective& operator=(const Collective&) = delete;
  virtual ~Collective() = default;

  virtual int rank() const = 0;  // from 0 to size() - 1
  virtual int size() const = 0;
  // Returns what moves tensors of the device between the ranks, for people: NCCL, Gloo, or nothing for one
  // rank.
  virtual std::string transport() const = 0;

  // Elementwise over the ranks, on the tensor's device, without a graph.
  virtual torch::Tensor sum(const torch::Tensor& tensor) const = 0;

  // rows (B, ...) of all ranks, in rank order -> (size() * B, ...). The own rows keep their gradient, times
  // size(): when every rank computes the same loss of the result, the mean over the ranks of its gradients is
  // then that loss's gradient.
  virtual torch::Tensor gather(const torch::Tensor& rows) const = 0;

  // Distinct leaves that require gradients, in the same order on every rank.
  virtual std::unique_ptr<AveragedBackward> averaged_backward(
      const std::vector<torch::Tensor>& parameters) const = 0;
};

// Returns a world of one rank, whose functions cost nothing.
std::shared_ptr<const Collective> single_rank();

// Returns the mean of each number over the ranks.
std::vector<double> mean_over_ranks(const Collective& ranks, const std::vector<double>& values);

}  // namespace q3d::model::ranks
