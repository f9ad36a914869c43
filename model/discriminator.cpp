#include "model/discriminator.h"

#include <cmath>
#include <string>

#include "model/decoder.h"
#include "model/seeded_uniform.h"
#include "smal/sizes.h"

namespace q3d::model {
namespace {

constexpr std::int64_t kBodyJoints =
    smal::kNumJoints - 1;  // all but the one that carries the global orientation
constexpr std::int64_t kRotationNumbers = 9;
constexpr std::int64_t kJointWidth = 32;
constexpr std::int64_t kHiddenWidth = 1024;

}  // namespace

Discriminator::Discriminator(const Placement& placement) {
  const Placement exact = placement.unreduced();
  const auto convolution = [&](const std::string& name, std::int64_t in, torch::Tensor& weight,
                               torch::Tensor& bias) {
    const auto holder = register_module(name, std::make_shared<torch::nn::Module>());
    weight = holder->register_parameter("weight", torch::empty({kJointWidth, in, 1, 1}, exact.vector()));
    bias = holder->register_parameter("bias", torch::empty({kJointWidth}, exact.vector()));
  };
  const auto linear = [&](const std::string& name, std::int64_t in, std::int64_t out) {
    return register_module(name, std::make_shared<Linear>(in, out, exact));
  };
  convolution("D_conv1", kRotationNumbers, conv1_weight_, conv1_bias_);
  convolution("D_conv2", kJointWidth, conv2_weight_, conv2_bias_);
  const auto scores = register_module("pose_out", std::make_shared<torch::nn::Module>());
  for (std::int64_t joint = 0; joint < kBodyJoints; ++joint) {
    pose_out_.push_back(
        scores->register_module(std::to_string(joint), std::make_shared<Linear>(kJointWidth, 1, exact)));
  }
  betas_fc1_ = linear("betas_fc1", kBetas, 10);
  betas_fc2_ = linear("betas_fc2", 10, 5);
  betas_out_ = linear("betas_out", 5, 1);
  joints_fc1_ = linear("D_alljoints_fc1", kJointWidth * kBodyJoints, kHiddenWidth);
  joints_fc2_ = linear("D_alljoints_fc2", kHiddenWidth, kHiddenWidth);
  joints_out_ = linear("D_alljoints_out", kHiddenWidth, 1);
}

torch::Tensor Discriminator::forward(const torch::Tensor& rotations, const torch::Tensor& betas) const {
  torch::Tensor joints = rotations.flatten(2);  // (B, 34, 9)
  joints = torch::relu(torch::linear(joints, conv1_weight_.flatten(1), conv1_bias_));
  joints = torch::relu(torch::linear(joints, conv2_weight_.flatten(1), conv2_bias_));  // (B, 34, 32)
  std::vector<torch::Tensor> scores;
  for (std::size_t joint = 0; joint < pose_out_.size(); ++joint) {
    scores.push_back(pose_out_[joint]->forward(joints.select(1, static_cast<std::int64_t>(joint))));
  }
  const torch::Tensor shape = torch::relu(betas_fc2_->forward(torch::relu(betas_fc1_->forward(betas))));
  scores.push_back(betas_out_->forward(shape));
  const torch::Tensor flat =
      joints.transpose(1, 2).flatten(1);  // all joints of a channel, then the next channel
  const torch::Tensor together = torch::relu(joints_fc2_->forward(torch::relu(joints_fc1_->forward(flat))));
  scores.push_back(joints_out_->forward(together));
  return torch::cat(scores, 1);
}

void initialise(Discriminator& discriminator, std::uint64_t seed) {
  const at::NoGradGuard no_grad;
  for (auto& parameter : discriminator.named_parameters()) {
    torch::Tensor& values = parameter.value();
    torch::Tensor fresh = torch::zeros(values.sizes());
    if (values.dim() >= 2) {
      const auto fans = static_cast<double>(values.size(0) + values.size(1));  // 1 x 1 kernels
      fill_uniform(fresh, std::sqrt(6.0 / fans), seed, "discriminator." + parameter.key());
    }
    values.copy_(fresh);
  }
}

torch::Tensor adversarial_loss(const torch::Tensor& scores_of_predicted) {
  return (scores_of_predicted - 1.0).square().sum() / scores_of_predicted.size(0);
}

torch::Tensor discriminator_loss(const torch::Tensor& scores_of_predicted,
                                 const torch::Tensor& scores_of_true, const torch::Tensor& is_real) {
  const torch::Tensor real = ((scores_of_true - 1.0).square().sum(1) * is_real).sum();
  return (scores_of_predicted.square().sum() + real) / scores_of_predicted.size(0);
}

}  // namespace q3d::model
