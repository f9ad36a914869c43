#include "model/batch_in_parts.h"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

namespace q3d::model {

BatchInParts::BatchInParts(NetworkPass pass, const torch::Tensor& images, int parts)
    : pass_(std::move(pass)) {
  if (parts < 1 || parts > images.size(0)) {
    throw std::invalid_argument(fmt::format("got {} parts of a batch with {} images, expected 1 to {}", parts,
                                            images.size(0), images.size(0)));
  }
  if (parts == 1) {
    outputs_ = pass_(images);
    return;
  }
  std::vector<std::vector<torch::Tensor>> collected;  // by output and part
  for (const torch::Tensor& some : images.tensor_split(parts)) {
    parts_.push_back({some, Draws(images.device())});
    const std::vector<torch::Tensor> outputs = pass_(some);
    collected.resize(outputs.size());
    for (std::size_t k = 0; k < outputs.size(); ++k) collected[k].push_back(outputs[k].detach());
  }
  for (const auto& of_parts : collected) outputs_.push_back(torch::cat(of_parts).requires_grad_());
}

void BatchInParts::backward(const torch::Tensor& loss, ranks::AveragedBackward& averaged) {
  if (parts_.empty()) {
    averaged.run(loss);
    return;
  }
  loss.backward();  // down to the outputs
  std::int64_t first = 0;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const torch::Tensor inner = with_gradients_of(parts_[i], first);
    first += parts_[i].images.size(0);
    // The gradients of the parts add up on every rank by itself; the ranks meet once.
    if (i + 1 < parts_.size()) {
      inner.backward();
    } else {
      averaged.run(inner);
    }
  }
}

torch::Tensor BatchInParts::with_gradients_of(const Part& part, std::int64_t first) const {
  const RepeatedDraws draws(part.draws);
  const std::vector<torch::Tensor> outputs = pass_(part.images);
  torch::Tensor product = torch::zeros({}, outputs.front().options());
  for (std::size_t k = 0; k < outputs.size(); ++k) {
    const torch::Tensor& gradient = outputs_[k].grad();
    if (!outputs[k].requires_grad() || !gradient.defined()) continue;
    product = product + (outputs[k] * gradient.narrow(0, first, part.images.size(0))).sum();
  }
  return product;
}

}  // namespace q3d::model
