// Pre-training of the two image encoders. The paper starts from encoders that others trained: a ViT that
// knows animals' keypoints and a BioCLIP that knows species. Where no such weights fit, as for the small
// network, this gives both encoders the same knowledge from labelled pictures: the ViT learns in which of its
// tokens each keypoint lies, and both learn to name the species.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <memory>

#include "model/learner.h"
#include "model/net.h"
#include "model/optimiser.h"
#include "model/ranks/collective.h"

namespace q3d::model {

struct EncoderTrainerOptions {
  AdamWOptions adamw;
  RateSchedule schedule;
  StemTraining stem;
  double largest_gradient_norm = 0.0;  // longer gradients are scaled down to it; 0 = never
  Precision precision = Precision::float32;
  int parts = 1;             // of a batch, computed one after the other (BatchInParts)
  std::int64_t species = 0;  // number of names
  std::uint64_t seed = 0;    // of the heads' weights
};

// The keypoints' positions on the ViT's grid of tokens. keypoints (B, 26, 3): x, y in crop units and a
// weight.
struct TokenTargets {
  torch::Tensor share;   // (B, 26, 192) float32: bilinear shares of the four nearest tokens, summing to 1
  torch::Tensor weight;  // (B, 26) float32: 0 also for keypoints outside the grid
};
TokenTargets token_targets(const torch::Tensor& keypoints);

class EncoderTrainer : public Learner {
 public:
  // Trains net's encoders and leaves its other parameters alone. Throws std::invalid_argument when the net
  // does not hold float32 or there are fewer than two species.
  EncoderTrainer(std::shared_ptr<PrimaNet> net, const EncoderTrainerOptions& options,
                 std::shared_ptr<const ranks::Collective> ranks = ranks::single_rank());

  PrimaNet& net() const override { return *net_; }
  StepReport step(const TrainingBatch& batch) override;
  smal::tensors::NamedTensors state() const override;
  void restore(const smal::tensors::SafeTensors& file) override;

 private:
  class Heads;
  // Returns logits: of the keypoints (B, 192, 26), of the species by the backbone and by the BioCLIP encoder
  // (B, species).
  std::vector<torch::Tensor> pass(const torch::Tensor& images) const;

  std::shared_ptr<PrimaNet> net_;
  EncoderTrainerOptions options_;
  std::shared_ptr<Heads> heads_;
  std::shared_ptr<const ranks::Collective> ranks_;
  AdamW optimiser_;
  std::unique_ptr<ranks::AveragedBackward> backward_;
  std::int64_t steps_ = 0;
};

}  // namespace q3d::model
