// Recomputed parts, compared with plain calls, bit for bit.
#include "model/recomputed.h"

#include <gtest/gtest.h>
#include <torch/csrc/autograd/function.h>

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "model/config.h"
#include "model/init.h"
#include "model/mixed_precision.h"
#include "model/net.h"

namespace q3d::model {
namespace {

struct Result {
  torch::Tensor output;
  torch::Tensor input_gradient;
  std::vector<torch::Tensor> gradients;
};

// Computes part(input), the gradients of a weighted sum of it, and what the generator draws next.
Result run(const NetworkPart& part, const torch::Tensor& input, const std::vector<torch::Tensor>& parameters,
           bool is_recomputed, bool is_mixed) {
  at::manual_seed(5);
  for (const torch::Tensor& parameter : parameters) parameter.mutable_grad().reset();
  const torch::Tensor leaf = input.detach().clone().requires_grad_();
  Result result;
  {
    const MixedPrecision mixed(torch::kCPU, is_mixed);
    const torch::Tensor x = leaf * 2.0;
    result.output = is_recomputed ? recomputed(part, x, parameters) : part(x);
  }
  const torch::Tensor weights = torch::linspace(-1.0, 1.0, result.output.numel()).view_as(result.output);
  (result.output.to(torch::kFloat32) * weights).sum().backward();
  result.input_gradient = leaf.grad();
  for (const torch::Tensor& parameter : parameters) result.gradients.push_back(parameter.grad());
  result.gradients.push_back(torch::rand({3}));
  return result;
}

void expect_equal(const Result& a, const Result& b) {
  EXPECT_TRUE(torch::equal(a.output, b.output));
  EXPECT_TRUE(torch::equal(a.input_gradient, b.input_gradient));
  ASSERT_EQ(a.gradients.size(), b.gradients.size());
  for (std::size_t i = 0; i < a.gradients.size(); ++i) {
    ASSERT_EQ(a.gradients[i].defined(), b.gradients[i].defined()) << i;
    if (!a.gradients[i].defined()) continue;
    EXPECT_TRUE(torch::equal(a.gradients[i], b.gradients[i])) << i;
  }
}

TEST(Recomputed, EqualsAPlainCallWithDrawsAndInMixedPrecision) {
  at::manual_seed(1);
  const torch::Tensor weight = torch::randn({6, 6}).requires_grad_();
  const torch::Tensor frozen = torch::randn({6});
  const torch::Tensor unused = torch::randn({2}).requires_grad_();
  const NetworkPart part = [&](const torch::Tensor& x) {
    const torch::Tensor y = torch::linear(x, weight, frozen);
    return x + torch::gelu(y) * torch::empty({x.size(0), 1}).bernoulli_(0.5);
  };
  for (const bool is_mixed : {false, true}) {
    const auto of = [&](bool is_recomputed) {
      return run(part, torch::linspace(-1, 1, 48).view({8, 6}), {weight, frozen, unused}, is_recomputed,
                 is_mixed);
    };
    const Result plain = of(false);
    expect_equal(plain, of(true));
    EXPECT_FALSE(plain.gradients[1].defined());
  }
}

TEST(Recomputed, ComputesThePartAgainInTheBackwardPass) {
  int calls = 0;
  const NetworkPart part = [&](const torch::Tensor& x) {
    ++calls;
    return x * x;
  };
  const torch::Tensor input = torch::full({1}, 3.0).requires_grad_();
  const torch::Tensor output = recomputed(part, input, {});
  EXPECT_EQ(calls, 1);
  output.backward();
  EXPECT_EQ(calls, 2);
  EXPECT_EQ(input.grad().item<float>(), 6.0F);
}

TEST(Recomputed, IsAPlainCallWithoutGradients) {
  const at::NoGradGuard none;
  int calls = 0;
  const NetworkPart part = [&](const torch::Tensor& x) {
    ++calls;
    return x * 3.0;
  };
  EXPECT_EQ(recomputed(part, torch::ones({1}), {}).item<float>(), 3.0F);
  EXPECT_EQ(calls, 1);
}

// Returns how many nodes of the graph behind a result have a name that contains the word.
std::size_t count_nodes(const torch::Tensor& result, const std::string& word) {
  std::set<torch::autograd::Node*> seen;
  std::vector<torch::autograd::Node*> open{result.grad_fn().get()};
  while (!open.empty()) {
    torch::autograd::Node* node = open.back();
    open.pop_back();
    if (node == nullptr || !seen.insert(node).second) continue;
    for (const auto& edge : node->next_edges()) open.push_back(edge.function.get());
  }
  return static_cast<std::size_t>(std::count_if(seen.begin(), seen.end(), [&](torch::autograd::Node* node) {
    return node->name().find(word) != std::string::npos;
  }));
}

// Returns the ViT's tokens in training, and the gradients of a weighted sum of them.
std::vector<torch::Tensor> tokens_and_gradients(PrimaNet& net, bool recomputes) {
  at::manual_seed(3);
  net.recompute_blocks(recomputes);
  net.zero_grad();
  const torch::Tensor images = torch::linspace(-1, 1, 2 * 3 * 256 * 256).view({2, 3, 256, 256});
  const torch::Tensor tokens = net.image_tokens(images);
  const auto blocks = static_cast<std::size_t>(net.config().depth);
  EXPECT_EQ(count_nodes(tokens, "Recomputed"), recomputes ? blocks : 0U);
  (tokens * torch::linspace(-1, 1, tokens.numel()).view_as(tokens)).sum().backward();
  std::vector<torch::Tensor> all{tokens.detach()};
  for (const torch::Tensor& parameter : net.backbone().parameters()) all.push_back(parameter.grad().clone());
  return all;
}

TEST(Recomputed, AVitLearnsTheSame) {
  PrimaConfig config = named_config("tiny");
  config.depth = 3;
  config.drop_path = 0.5;
  PrimaNet net(config);
  initialise(net, 1);
  const auto plain = tokens_and_gradients(net, false);
  const auto again = tokens_and_gradients(net, true);
  ASSERT_EQ(plain.size(), again.size());
  for (std::size_t i = 0; i < plain.size(); ++i) EXPECT_TRUE(torch::equal(plain[i], again[i])) << i;
}

}  // namespace
}  // namespace q3d::model
