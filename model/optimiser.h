// AdamW over groups of named parameters, with a state that survives the disk bit for bit.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <string>
#include <vector>

#include "smal/tensors/safetensors.h"

namespace q3d::model {

class PrimaNet;

struct ParameterGroup {
  std::vector<std::pair<std::string, torch::Tensor>> parameters;  // leaves that require gradients
  double rate_scale = 1.0;                                        // times the learning rate of the step
};

struct AdamWOptions {
  double beta1 = 0.9;
  double beta2 = 0.999;
  double epsilon = 1e-8;
  double weight_decay = 1e-4;  // on everything, norms and biases included, as in the official code

  bool operator==(const AdamWOptions&) const = default;
};

// Loshchilov and Hutter 2019, as torch.optim.AdamW computes it. A parameter without a gradient is left alone.
class AdamW {
 public:
  AdamW(std::vector<ParameterGroup> groups, const AdamWOptions& options);

  // Returns the parameters of all groups, in order.
  std::vector<torch::Tensor> parameters() const;

  void zero_grad();
  void step(double learning_rate);

  // The L2 norm of all gradients together: a scalar on the parameters' device.
  torch::Tensor gradient_norm() const;
  // Scales all gradients by min(1, largest / norm), as torch.nn.utils.clip_grad_norm_ does.
  void clip(const torch::Tensor& norm, double largest);

  void append_state(smal::tensors::NamedTensors& state, const std::string& prefix) const;
  // Throws std::runtime_error naming the tensor, got and expected.
  void restore_state(const smal::tensors::SafeTensors& file, const std::string& prefix);

 private:
  struct Slot {
    std::string name;
    torch::Tensor parameter;
    torch::Tensor first_moment;   // like the parameter
    torch::Tensor second_moment;  // like the parameter
    torch::Tensor steps;          // float32 scalar on the parameter's device, as the fused kernel wants it
  };
  struct Group {
    std::vector<Slot> slots;
    double rate_scale;
  };
  std::vector<torch::Tensor> gradients() const;

  std::vector<Group> groups_;
  AdamWOptions options_;
};

// Says how the EfficientNets of a network learn. Weights that know pictures already need small steps.
struct StemTraining {
  double rate_scale = 1.0;  // beside the rate that their encoder has
  std::int64_t frozen_blocks =
      0;  // the first convolution and so many blocks keep their values; 0 = all learn

  bool operator==(const StemTraining&) const = default;
};

// Official code: PRIMA.get_parameters and configure_optimizers. The backbone learns at a tenth of the rate;
// the decoder and BioCLIP's projection at the full rate. BioCLIP's encoder is in no group, and its gradients
// are switched off, unless the network trains it instead of keeping it frozen. Groups: the backbone, the
// rest, and after them, where the network has such, the EfficientNets of the backbone and of a BioCLIP that
// learns.
inline constexpr double kBackboneRateScale = 0.1;
std::vector<ParameterGroup> parameter_groups(PrimaNet& net, double backbone_rate_scale = kBackboneRateScale,
                                             const StemTraining& stem = {});

// The two image encoders, for their pre-training: all but the EfficientNets, then these where the network has
// such. Gradients of the rest of the network are switched off.
std::vector<ParameterGroup> encoder_groups(PrimaNet& net, const StemTraining& stem = {});

// The learning rate over a run. Paper: linear decay; official code: none.
struct RateSchedule {
  double learning_rate = 3.75e-6;
  std::int64_t warm_up_steps = 0;   // linear from learning_rate / warm_up_steps
  std::int64_t decay_end_step = 0;  // linear to zero at this step from the end of the warm-up; 0 = constant

  bool operator==(const RateSchedule&) const = default;
};
double rate_at(const RateSchedule& schedule, std::int64_t step);

}  // namespace q3d::model
