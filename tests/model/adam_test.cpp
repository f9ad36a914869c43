// Our step against LibTorch's optimiser, which takes dense gradients and one number of steps.
#include "model/adam.h"

#include <ATen/ops/_fused_adam.h>
#include <gtest/gtest.h>

#include "model/device.h"

namespace q3d::model {
namespace {

struct Instances {
  AdamState state;
  InstanceGradient gradient;

  explicit Instances(torch::ScalarType dtype) {
    at::manual_seed(5);
    const auto random = [&](at::IntArrayRef sizes) { return torch::randn(sizes, torch::kFloat64).to(dtype); };
    state = {random({3, 7, 33}), random({3, 7, 33}), random({3, 7, 33}).square()};
    gradient.outer_products = {{random({3, 7}), random({3, 33})}, {random({3, 7}), random({3, 33})}};
  }
};

// The parameters after the step, by LibTorch in float64.
torch::Tensor expected(const Instances& instances, const std::vector<std::int64_t>& steps, double rate) {
  torch::Tensor gradient = torch::zeros({3, 7, 33}, torch::kFloat64);
  for (const auto& [left, right] : instances.gradient.outer_products) {
    gradient += left.to(torch::kFloat64).unsqueeze(2) * right.to(torch::kFloat64).unsqueeze(1);
  }
  std::vector<torch::Tensor> results;
  for (std::int64_t i = 0; i < 3; ++i) {
    const auto row = [&](const torch::Tensor& all) { return all[i].to(torch::kFloat64).clone(); };
    std::vector<torch::Tensor> parameter{row(instances.state.parameter)};
    std::vector<torch::Tensor> first{row(instances.state.first_moment)};
    std::vector<torch::Tensor> second{row(instances.state.second_moment)};
    const std::vector<torch::Tensor> count{
        torch::tensor(static_cast<float>(steps[static_cast<std::size_t>(i)]))};
    at::_fused_adam_(parameter, {gradient[i]}, first, second, {}, count, rate, 0.9, 0.999, 0.0, 1e-8, false,
                     false);
    results.push_back(parameter[0]);
  }
  return torch::stack(results);
}

TEST(AdamStep, IsThatOfLibTorchForEachInstance) {
  const std::vector<std::int64_t> steps{1, 4, 60};
  for (const auto dtype : {torch::kFloat32, torch::kFloat64}) {
    const Instances instances(dtype);
    const torch::Tensor wanted = expected(instances, steps, 0.01);
    const torch::Tensor before = instances.state.parameter.clone();
    adam_step({instances.state}, {instances.gradient}, steps, 0.01);
    const double error = (instances.state.parameter - wanted).abs().max().item<double>();
    EXPECT_LE(error, dtype == torch::kFloat32 ? 2e-6 : 1e-8) << dtype;
    EXPECT_GT((instances.state.parameter - before).abs().max().item<double>(), 1e-3);
  }
}

TEST(AdamStep, ThreadsChangeNoBit) {
  std::vector<torch::Tensor> results;
  for (const int threads : {1, 2, 4}) {
    configure_compute(threads);
    const Instances instances(torch::kFloat32);
    adam_step({instances.state}, {instances.gradient}, {1, 2, 3}, 0.01);
    results.push_back(instances.state.parameter);
  }
  configure_compute(1);
  EXPECT_TRUE(torch::equal(results[0], results[1]));
  EXPECT_TRUE(torch::equal(results[0], results[2]));
}

}  // namespace
}  // namespace q3d::model
