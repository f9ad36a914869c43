#include "model/batch_in_parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/nn/functional/dropout.h>

#include <stdexcept>

namespace q3d::model {
namespace {

using ::testing::ElementsAre;

constexpr std::int64_t kSamples = 7;

// A network of two outputs. It notes how many images each of its passes had.
class BatchInPartsTest : public ::testing::Test {
 protected:
  BatchInPartsTest() {
    at::manual_seed(5);
    const auto options = torch::TensorOptions(torch::kFloat64);
    images_ = torch::randn({kSamples, 6}, options);
    weight_ = torch::randn({6, 4}, options).requires_grad_();
    other_ = torch::randn({4, 3}, options).requires_grad_();
  }

  NetworkPass pass(double dropout = 0.0) {
    return [this, dropout](const torch::Tensor& images) {
      sizes_.push_back(images.size(0));
      const torch::Tensor hidden = torch::nn::functional::dropout(
          images.matmul(weight_).tanh(), torch::nn::functional::DropoutFuncOptions().p(dropout));
      return std::vector<torch::Tensor>{hidden, hidden.matmul(other_)};
    };
  }

  // Compares every sample with every other, as the contrastive loss does.
  static torch::Tensor loss_of(const std::vector<torch::Tensor>& outputs) {
    const torch::Tensor similarity = outputs[0].matmul(outputs[0].t());
    return similarity.exp().sum().log() + outputs[1].square().sum();
  }

  struct Gradients {
    torch::Tensor weight, other;
  };

  Gradients taken() {
    const Gradients gradients{weight_.grad().clone(), other_.grad().clone()};
    weight_.mutable_grad().reset();
    other_.mutable_grad().reset();
    return gradients;
  }

  Gradients in_parts(int parts, double dropout = 0.0) {
    at::manual_seed(9);
    const auto averaged = ranks::single_rank()->averaged_backward({weight_, other_});
    BatchInParts batch(pass(dropout), images_, parts);
    batch.backward(loss_of(batch.outputs()), *averaged);
    return taken();
  }

  // All parts with one graph, which is what computing them again saves.
  Gradients with_one_graph(int parts, double dropout) {
    at::manual_seed(9);
    std::vector<torch::Tensor> hidden, outputs;
    for (const torch::Tensor& part : images_.tensor_split(parts)) {
      const std::vector<torch::Tensor> of_part = pass(dropout)(part);
      hidden.push_back(of_part[0]);
      outputs.push_back(of_part[1]);
    }
    loss_of({torch::cat(hidden), torch::cat(outputs)}).backward();
    return taken();
  }

  static void expect_near(const Gradients& a, const Gradients& b) {
    EXPECT_TRUE(torch::allclose(a.weight, b.weight, 1e-12, 1e-12)) << a.weight << b.weight;
    EXPECT_TRUE(torch::allclose(a.other, b.other, 1e-12, 1e-12)) << a.other << b.other;
  }

  torch::Tensor images_, weight_, other_;
  std::vector<std::int64_t> sizes_;
};

TEST_F(BatchInPartsTest, GradientsAreThoseOfTheWholeBatch) {
  const Gradients whole = in_parts(1);
  expect_near(in_parts(2), whole);
  expect_near(in_parts(3), whole);
  expect_near(in_parts(kSamples), whole);
}

TEST_F(BatchInPartsTest, TheSecondPassDrawsWhatTheFirstDid) {
  expect_near(in_parts(3, 0.5), with_one_graph(3, 0.5));
}

TEST_F(BatchInPartsTest, TheSecondPassesLeaveTheGeneratorWhereItWas) {
  const auto averaged = ranks::single_rank()->averaged_backward({weight_, other_});
  BatchInParts batch(pass(0.5), images_, 3);
  at::manual_seed(11);  // stands for draws between the passes
  const torch::Tensor next = torch::rand({4});
  at::manual_seed(11);
  batch.backward(loss_of(batch.outputs()), *averaged);
  EXPECT_TRUE(torch::equal(torch::rand({4}), next));
}

TEST_F(BatchInPartsTest, EachPartIsComputedTwiceAndAWholeBatchOnce) {
  in_parts(1);
  EXPECT_THAT(sizes_, ElementsAre(7));
  sizes_.clear();
  in_parts(3);
  EXPECT_THAT(sizes_, ElementsAre(3, 2, 2, 3, 2, 2));
}

TEST_F(BatchInPartsTest, OutputsOfPartsHoldNoGraph) {
  const BatchInParts whole(pass(), images_, 1);
  const BatchInParts parts(pass(), images_, 2);
  EXPECT_FALSE(whole.outputs()[0].is_leaf());
  EXPECT_TRUE(parts.outputs()[0].is_leaf());
  EXPECT_TRUE(torch::allclose(whole.outputs()[1], parts.outputs()[1]));
}

TEST_F(BatchInPartsTest, AnOutputThatTheLossLeavesOutIsNoFault) {
  const auto averaged = ranks::single_rank()->averaged_backward({weight_, other_});
  BatchInParts batch(pass(), images_, 2);
  batch.backward(batch.outputs()[0].sum(), *averaged);
  EXPECT_TRUE(weight_.grad().defined());
  EXPECT_FALSE(other_.grad().defined());
}

TEST_F(BatchInPartsTest, ThereAreAsManyPartsAsImagesAtMost) {
  EXPECT_THROW(BatchInParts(pass(), images_, 0), std::invalid_argument);
  EXPECT_THROW(BatchInParts(pass(), images_, kSamples + 1), std::invalid_argument);
}

}  // namespace
}  // namespace q3d::model
